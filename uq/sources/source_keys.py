"""The keys of ``[[source]]``: those of all sources, those of a draw, and those of a kind of error on a target."""

import math
from functools import cache
from typing import Annotated, Any, Literal, get_args

import msgspec
import numpy as np

from rig.toml_tables import Name, TomlTable
from uq.files.schema import matrix
from uq.sources.source import KINDS, ErrorKind


class SourceTable(TomlTable, frozen=True, kw_only=True):
    """``[[source]]``: a source of error; its other keys depend on target and kind."""

    name: Name
    """Name of the source in results and correlations, by which its random stream is keyed."""
    group: Name
    """Group in which the source counts, such as load_cell."""
    reference: str = ""
    """Publication or document from which the source's figures come."""


class DrawTable(SourceTable, frozen=True, kw_only=True):
    """Keys of a source that is drawn, to which each kind adds sizes in the unit of its target."""

    distribution: Literal["normal", "rectangular", "triangular", "u_shaped", "student_t", "samples"] | None = None
    """Distribution of the draw; missing: normal."""
    degrees_of_freedom: float | None = None
    """Degrees of freedom of the stated width; missing: infinite."""
    datasheet: str | tuple[str, ...] | None = None
    """A datasheet's statement, for all axes or one for each, such as "±0.5 % of full scale, k = 2"."""
    samples: str | None = None
    """Name of a file of samples beside the experiment."""
    unit: str | None = None
    """Name of the unit of a file of samples."""


SIZES = {
    "sigma": "Standard deviation of the draw.",
    "half_width": "Half the width of a distribution between limits.",
    "scale": "Scale of Student's t.",
    "full_scale": "Full scale to which the per cent of a datasheet refer.",
    "mean": "Expectation of the draw: a known effect that is not corrected.",
    "correlation": "Correlation matrix of the draw's axes.",
}
"""Meaning of the keys that are in the unit of the erroneous quantity."""


def draw_keys(kind: ErrorKind, target: str) -> list[tuple[str, Any, None]]:
    """Return the fields that a source of a kind adds to :class:`DrawTable`: those in the unit of its target."""
    axes = math.prod(kind.shape)
    forms = dict.fromkeys(("sigma", "half_width", "scale"), kind.figures(target, least=0))
    forms |= {"full_scale": kind.full_scale(target)}
    forms |= {} if kind.noise else {"mean": kind.figures(target)}
    forms |= {"correlation": matrix(axes, axes)} if axes > 1 else {}
    return [
        (key, Annotated[np.ndarray, form, msgspec.Meta(description=SIZES[key])] | None, None)
        for key, form in forms.items()
    ]


@cache
def source_table(target: str, name: str) -> Any:
    """Return the declaration of ``[[source]]`` for a kind of error on a target."""
    kind = KINDS[target, name]
    base, drawn = (DrawTable, draw_keys(kind, target)) if kind.constant or kind.white else (SourceTable, [])
    hints = kind.keys(target).items()
    undrawn = [(key, hint, None) if type(None) in get_args(hint) else (key, hint) for key, hint in hints]
    keys = [("target", Literal[target]), ("kind", Literal[name]), *undrawn, *drawn]
    return msgspec.defstruct(f"{target}_{name}", keys, bases=(base,), frozen=True, kw_only=True)
