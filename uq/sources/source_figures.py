"""Figures of a ``[[source]]`` in SI: in the unit of what errs, in the shape of its draw."""

from typing import Any

import numpy as np

from uq.files.document import REQUIRED, ExperimentError, Table
from uq.files.units import UnitError, quantity, scale
from uq.sources.source import CONSTANT, TARGET_UNITS, Kind, Target

WRENCH_UNITS = ("N", "N", "N", "N*m", "N*m", "N*m")
CROSS_TALK_UNITS = {("N", "N"): "%", ("N*m", "N*m"): "%", ("N", "N*m"): "N/(N*m)", ("N*m", "N"): "N*m/N"}
"""Unit of cross-talk, of a channel from a component."""
OWN_UNITS = {"scale": "%", "cross_talk": "%", "misalignment": "rad", "delay": "s"}
"""Units of kinds that are not the target's; a relative figure is read in per cent."""


class Figures:
    """Reads a source's figures."""

    def __init__(self, table: Table, target: Target, kind: Kind):
        self.table = table
        self.shape: tuple[int, ...] = CONSTANT.get((target, kind), (3,))
        """Shape of the draw."""
        self.unit: str = OWN_UNITS.get(kind) or TARGET_UNITS[target] + ("/s" if kind == "drift" else "")
        """Unit in which figures are read; per cent are returned as parts of one."""
        self._si = 0.01 if self.unit == "%" else 1.0

    def read(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a key's figures in SI, in the shape of the draw; the default where it is missing."""
        if key not in self.table.content and default is not REQUIRED:
            return default
        if self.shape == (6, 6):
            return self._cross_talk(key)
        if self.shape == ():
            return np.array(self.table.quantity(key, self.unit) * self._si)
        return self.table.vector(key, self.unit) * self._si

    def scale_of(self, unit: str) -> float:
        """Return how many of the SI unit one of ``unit`` is."""
        try:
            return scale(unit, self.unit) * self._si
        except UnitError as error:
            raise ExperimentError(f"{self.table.path('unit')} {error}") from None

    def wholes(self) -> list[float | None]:
        """Return each axis's full scale in :attr:`unit`, of which a datasheet's per cent are; None where not stated."""
        if self.unit == "%":
            return [100.0] * (1 if self.shape == (6, 6) else int(np.prod(self.shape)))
        if "full_scale" not in self.table.content:
            return [None] * int(np.prod(self.shape))
        values = self.read("full_scale")
        return np.atleast_1d(_positive(self.table, "full_scale", values)).tolist()

    def placed(self, scales: np.ndarray) -> np.ndarray:
        """Return figures in :attr:`unit`, one an axis (for cross-talk one in all), in SI and the shape of the draw."""
        if self.shape == (6, 6):
            return self._of_full_scale(float(scales[0]) * self._si)
        return (scales * self._si).reshape(self.shape)

    def _cross_talk(self, key: str) -> np.ndarray:
        """A 6×6 matrix with its units; or one figure in per cent of full scale, for all but the diagonal."""
        raw = self.table.raw(key)
        if isinstance(raw, str):
            return self._of_full_scale(self.table.quantity(key, "%") * self._si)
        if not isinstance(raw, list) or [len(row) for row in raw if isinstance(row, list)] != [6] * 6:
            raise ExperimentError(f"{self.table.path(key)} is {raw!r}: write six rows of six values, or one in %")
        units = [[CROSS_TALK_UNITS[channel, of] for of in WRENCH_UNITS] for channel in WRENCH_UNITS]
        return np.array([[self._item(key, raw, (i, j), units[i][j]) for j in range(6)] for i in range(6)])

    def _of_full_scale(self, part: float) -> np.ndarray:
        """Cross-talk of ``part`` of each channel's full scale at the full scale of each other component."""
        raw = self.table.raw("full_scale")
        if not isinstance(raw, list) or len(raw) != 6:
            raise ExperimentError(f"{self.table.path('full_scale')} is {raw!r}: write six values, force then moment")
        full = np.array([self._item("full_scale", raw, (i,), unit) for i, unit in enumerate(WRENCH_UNITS)])
        return part * np.outer(_positive(self.table, "full_scale", full), 1 / full) * (1 - np.eye(6))

    def _item(self, key: str, raw: Any, index: tuple[int, ...], unit: str) -> float:
        where = self.table.path(key) + "".join(f"[{i}]" for i in index)
        for i in index:
            raw = raw[i]
        try:
            return quantity(raw, unit) * (0.01 if unit == "%" else 1.0)
        except UnitError as error:
            raise ExperimentError(f"{where} {error}") from None


def not_negative(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    """Return figures that were read from a key, or refuse a negative one."""
    return _refuse(table, key, values, np.asarray(values < 0), "write zero or more")


def _positive(table: Table, key: str, values: np.ndarray) -> np.ndarray:
    return _refuse(table, key, values, np.asarray(values <= 0), "write more than zero")


def positive(table: Table, key: str, unit: str) -> np.ndarray:
    """Return three values above zero."""
    return _positive(table, key, table.vector(key, unit))


def _refuse(table: Table, key: str, values: np.ndarray, wrong: np.ndarray, advice: str) -> np.ndarray:
    if wrong.any():
        raw, where = table.content[key], table.path(key)
        for index in np.argwhere(wrong)[0] if isinstance(raw, list) else ():
            raw, where = raw[index], f"{where}[{index}]"
        raise ExperimentError(f"{where} is {raw!r}: {advice}")
    return values
