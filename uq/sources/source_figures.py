"""Figures of a ``[[source]]`` in SI: in the unit of what errs, in the shape of its draw."""

from typing import Any

import numpy as np

from uq.files.document import REQUIRED, ExperimentError, Table
from uq.files.units import UnitError, scale


class Figures:
    """Reads a source's figures."""

    def __init__(self, table: Table, shape: tuple[int, ...], unit: str):
        self.table = table
        self.shape = shape
        """Shape of the draw: three axes, or one figure."""
        self.unit = unit
        """Unit in which figures are read; per cent are returned as parts of one."""
        self.si = 0.01 if unit == "%" else 1.0
        """How many of the SI unit one of :attr:`unit` is."""

    def read(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a key's figures in SI, in the shape of the draw; the default where it is missing."""
        if key not in self.table.content and default is not REQUIRED:
            return default
        if self.shape == ():
            return np.array(self.table.quantity(key, self.unit) * self.si)
        return self.table.vector(key, self.unit) * self.si

    def scale_of(self, unit: str) -> float:
        """Return how many of the SI unit one of ``unit`` is."""
        try:
            return scale(unit, self.unit) * self.si
        except UnitError as error:
            raise ExperimentError(f"{self.table.path('unit')} {error}") from None

    def wholes(self) -> list[float | None]:
        """Return each axis's full scale in :attr:`unit`, of which a datasheet's per cent are; None where not stated."""
        axes = int(np.prod(self.shape))
        if self.unit == "%":
            return [100.0] * axes
        if "full_scale" not in self.table.content:
            return [None] * axes
        return np.atleast_1d(above_zero(self.table, "full_scale", self.read("full_scale"))).tolist()

    def placed(self, scales: np.ndarray) -> np.ndarray:
        """Return figures in :attr:`unit`, one an axis, in SI and the shape of the draw."""
        return (scales * self.si).reshape(self.shape)


def not_negative(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    """Return figures that were read from a key, or refuse a negative one."""
    return _refuse(table, key, values, np.asarray(values < 0), "write zero or more")


def above_zero(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    """Return figures that were read from a key, or refuse one that is not above zero."""
    return _refuse(table, key, values, np.asarray(values <= 0), "write more than zero")


def _refuse(table: Table, key: str, values: np.ndarray, wrong: np.ndarray, advice: str) -> np.ndarray:
    if wrong.any():
        raw, where = table.content[key], table.path(key)
        for index in np.argwhere(wrong)[0] if isinstance(raw, list) else ():
            raw, where = raw[index], f"{where}[{index}]"
        raise ExperimentError(f"{where} is {raw!r}: {advice}")
    return values
