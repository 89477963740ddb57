"""A key that holds a rotation: signed axes, a quaternion, or a matrix."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from identify.rigid_body.rotation import from_axes, from_quaternion, nearest_rotation
from rig.toml_tables import TomlTable, read_table, written
from uq.files.schema import finite, matrix_schema


class QuaternionTable(TomlTable, frozen=True, kw_only=True):
    """A rotation as a unit quaternion."""

    w: float
    x: float
    y: float
    z: float


def read_rotation(path: str, raw: Any) -> np.ndarray:
    """Return a rotation matrix from ``"x, -z, y"``, ``{w, x, y, z}`` or three rows of three numbers.

    Raises:
        ValueError: it is no rotation.
    """
    if isinstance(raw, str):
        return from_axes(raw)
    if isinstance(raw, Mapping):
        quaternion = read_table(path, raw, QuaternionTable)
        return from_quaternion(quaternion.w, quaternion.x, quaternion.y, quaternion.z)
    return nearest_rotation(finite(raw, (3, 3)))


SIGNED_AXES = r"^\s*[+-]?\s*[xyzXYZ]\s*(,\s*[+-]?\s*[xyzXYZ]\s*){2}$"
ROTATION = written(
    read_rotation,
    {
        "title": "rotation",
        "anyOf": [
            {"type": "string", "pattern": SIGNED_AXES, "examples": ["-y, z, x"]},
            {
                "type": "object",
                "properties": {component: {"type": "number"} for component in "wxyz"},
                "required": list("wxyz"),
                "additionalProperties": False,
            },
            matrix_schema(3, 3),
        ],
    },
)
"""The annotation of a rotation matrix that is written in one of these ways."""
