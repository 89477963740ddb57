"""Values of any kind as JSON takes them: what a result records of an experiment."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import date, time
from typing import Any

import jax
import numpy as np

from rig.toml_tables import TomlTable


def plain_values(value: Any) -> Any:
    """Return a value as numbers, strings, lists and dicts, for JSON."""
    if isinstance(value, Mapping):
        return {key: plain_values(item) for key, item in value.items()}
    if isinstance(value, TomlTable):
        return {"class": type(value).__name__} | plain_values(value.to_dict())
    if is_dataclass(value):
        return {"class": type(value).__name__} | {f.name: plain_values(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (list, tuple)):
        return [plain_values(item) for item in value]
    if isinstance(value, (date, time)):
        return value.isoformat()
    if isinstance(value, (np.ndarray, np.generic, jax.Array)):
        return plain_values(np.asarray(value).tolist())
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
