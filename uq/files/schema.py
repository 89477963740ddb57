"""Annotations for keys of an experiment file: values with units, rotations, matrices; and how tables are read.

A key is a field of a :class:`rig.toml_tables.TomlTable`::

    class Scale(TomlTable, frozen=True, kw_only=True):
        mass: Annotated[float, in_unit("kg", above=0)]
        "Mass on the load cell."
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

import msgspec
import numpy as np

from identify.rigid_body.rotation import from_axes, from_quaternion, nearest_rotation
from rig.exceptions import quoted
from rig.toml_tables import TomlError, TomlTable, read_table, read_value, written
from uq.files.mistakes import ExperimentError
from uq.files.units import quantity

T = TypeVar("T")
Table = TypeVar("Table", bound=TomlTable)
Axes = tuple[T, T, T]
"""Three values, one per axis."""
Component = Literal["I11", "I12", "I13", "I22", "I23", "I33"]
"""A component of a tensor."""
QUANTITY = r"^\s*[+-]?(\d|\.\d)[\d.eE+-]* +\S.*$"
"""A number, a space and the name of a unit, as a JSON Schema's pattern."""


def in_unit(
    unit: str, *, above: float | int = -math.inf, least: float | int = -math.inf, most: float | int = math.inf
) -> msgspec.Meta:
    """Return the annotation of a float that is written with a unit of the dimension of ``unit``, and converted to it.

    Args:
        unit: the unit of the value.
        above: what the value must exceed.
        least: what it must not fall below.
        most: what it must not exceed.
    """

    def read(_: str, raw: Any) -> float:
        value = quantity(raw, unit)
        if value <= above:
            raise ValueError(f"is {quoted(raw)}: write a value above {'zero' if above == 0 else above}")
        if value < least:
            raise ValueError(f"is {quoted(raw)}: write {'zero' if least == 0 else least} or more")
        if value > most:
            raise ValueError(f"is {quoted(raw)}: write {most:g} {unit} or less")
        return value

    return written(read, quantity_schema(unit))


def quantity_schema(unit: str) -> dict[str, Any]:
    """Return the JSON Schema of a value with its unit."""
    form = {"type": "string", "pattern": QUANTITY, "format": f"quantity {unit}", "examples": [f"1 {unit}"]}
    return {"title": f"quantity in {unit}", **form}


def vector_schema(unit: str) -> dict[str, Any]:
    """Return the JSON Schema of three values with their units."""
    items = {"type": "array", "items": quantity_schema(unit), "minItems": 3, "maxItems": 3}
    return {"title": f"vector in {unit}", **items}


def vector(unit: str) -> msgspec.Meta:
    """Return the annotation of an array of three values in ``unit``, one per axis."""
    items = Axes[Annotated[float, in_unit(unit)]]

    def read(path: str, raw: Any) -> np.ndarray:
        return np.array(read_value(path, raw, items))

    return written(read, vector_schema(unit))


def interval(unit: str, *, above: float | int = -math.inf) -> msgspec.Meta:
    """Return the annotation of two values in ``unit``, the lower first."""
    end = Annotated[float, in_unit(unit, above=above)]

    def read(path: str, raw: Any) -> tuple[float, float]:
        low, high = read_value(path, raw, tuple[end, end])
        if low >= high:
            raise ValueError(f"is {quoted(raw)}: write the lower limit first")
        return low, high

    return written(read, {"type": "array", "items": quantity_schema(unit), "minItems": 2, "maxItems": 2})


def matrix(rows: int, columns: int) -> msgspec.Meta:
    """Return the annotation of an array of finite numbers of this shape, written as a list of its rows."""

    def read(_: str, raw: Any) -> np.ndarray:
        return finite(raw, (rows, columns))

    return written(read, matrix_schema(rows, columns))


def matrix_schema(rows: int, columns: int) -> dict[str, Any]:
    """Return the JSON Schema of a list of rows of numbers."""
    row = {"type": "array", "items": {"type": "number"}, "minItems": columns, "maxItems": columns}
    return {"title": f"matrix {rows} by {columns}", "type": "array", "items": row, "minItems": rows, "maxItems": rows}


def finite(raw: Any, shape: tuple[int, int]) -> np.ndarray:
    """Return rows of finite numbers as an array of this shape.

    Raises:
        ValueError: what is written is anything else.
    """
    try:
        values = np.array(msgspec.convert(raw, list[list[float]]))
    except (msgspec.ValidationError, OverflowError, ValueError):  # also: rows of unequal length
        values = np.array(np.nan)
    if values.shape != shape or not (np.abs(values) < 1e300).all():
        raise ValueError(f"is {quoted(raw)}: write {shape[0]} rows of {shape[1]} finite numbers")
    return values


def declared_table(where: str, raw: object, table: type[Table]) -> Table:
    """Return the values of a table of an experiment file; see :func:`rig.toml_tables.read_table`.

    Raises:
        ExperimentError: a key is missing or unknown, or a value is none that it may have.
    """
    try:
        return read_table(where, raw, table)
    except TomlError as error:
        raise ExperimentError(str(error)) from None


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
