"""Figures of a source as ``[[source]]`` writes them, with their units: of each axis, or one for all."""

import math
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np

from rig.toml_tables import read_value, written
from uq.files.schema import in_unit, quantity_schema, vector_schema


class DrawFigures(NamedTuple):
    """Figures of the size of a draw: one per axis, or one for all axes."""

    unit: str
    """Unit in which they are written."""
    shape: tuple[int, ...]
    """Shape of the draw."""

    def annotation(self, *, least: float | int = -math.inf) -> msgspec.Meta:
        """Return the annotation of the figures, in SI."""
        return figures(self.unit, self.shape, least=least)

    def full_scale(self) -> msgspec.Meta:
        """Return the annotation of the full scale, of which a datasheet's per cent are."""
        return figures(self.unit, self.shape, above=0)

    def wholes(self, full_scale: np.ndarray | None) -> list[float | None]:
        """Return each axis's full scale in the unit, of which a datasheet's per cent are; None: not stated."""
        if self.unit == "%":
            return [100.0] * math.prod(self.shape)
        return [None] * math.prod(self.shape) if full_scale is None else np.atleast_1d(full_scale).tolist()

    def placed(self, figure: np.ndarray, full_scale: np.ndarray | None) -> np.ndarray:
        """Return figures in SI, one per axis, in the shape of the draw."""
        return np.asarray(figure.reshape(self.shape))


def part_of(unit: str) -> float:
    """Return how many of the SI unit one of ``unit`` is: what is written in per cent counts as parts of one."""
    return 0.01 if unit == "%" else 1.0


def figures(
    unit: str, shape: tuple[int, ...], *, above: float | int = -math.inf, least: float | int = -math.inf
) -> Any:
    """Return the annotation of figures in SI that are written in ``unit``: one per axis or one for all axes, or one.

    Args:
        unit: unit of the figures; relative ones are read in per cent.
        shape: (3,) or ().
        above: what each must exceed.
        least: what none may fall below.
    """
    figure: Any = Annotated[float, in_unit(unit, above=above, least=least)]

    def read(path: str, raw: Any) -> np.ndarray:
        is_vector = shape and not isinstance(raw, str)
        values = np.array(read_value(path, raw, tuple[figure, figure, figure] if is_vector else figure))
        return np.full(shape, values * part_of(unit))

    scalar, vector = quantity_schema(unit), vector_schema(unit)
    either = {"title": f"value or vector in {unit}", "anyOf": [vector, scalar]}
    return written(read, either if shape else scalar)
