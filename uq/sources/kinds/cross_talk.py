"""Cross-talk of the load cell: each channel reads a part of every other component."""

from typing import Any

import numpy as np

from uq.files.document import REQUIRED, ExperimentError, Table
from uq.files.units import UnitError, quantity
from uq.sources.source import ErrorKind
from uq.sources.source_figures import Figures, above_zero

WRENCH_UNITS = ("N", "N", "N", "N*m", "N*m", "N*m")
UNITS = {("N", "N"): "%", ("N*m", "N*m"): "%", ("N", "N*m"): "N/(N*m)", ("N*m", "N"): "N*m/N"}
"""Unit of cross-talk, of a channel from a component."""


class CrossTalk(ErrorKind):
    """Adds X w to the wrench w = (F, M), X a 6×6 matrix."""

    name = "cross_talk"
    targets = {"wrench": "%"}
    shape = (6, 6)
    constant = True
    perturbs = {"wrench": "cell_cross_talk"}

    def figures(self, table: Table, target: str) -> Figures:
        """Return what reads a matrix with its units, or one figure in per cent of full scale."""
        return CrossTalkFigures(table, self.shape, self.targets[target])


class CrossTalkFigures(Figures):
    """Reads a 6×6 matrix with its units; or one figure in per cent of full scale, for all but the diagonal."""

    def read(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a key's figures in SI; the default where it is missing."""
        if key not in self.table.content and default is not REQUIRED:
            return default
        raw = self.table.raw(key)
        if isinstance(raw, str):
            return self._of_full_scale(self.table.quantity(key, "%") * self.si)
        if not isinstance(raw, list) or [len(row) for row in raw if isinstance(row, list)] != [6] * 6:
            raise ExperimentError(f"{self.table.path(key)} is {raw!r}: write six rows of six values, or one in %")
        units = [[UNITS[channel, of] for of in WRENCH_UNITS] for channel in WRENCH_UNITS]
        return np.array([[self._item(key, raw, (i, j), units[i][j]) for j in range(6)] for i in range(6)])

    def wholes(self) -> list[float | None]:
        """Return that one statement, in per cent, is for all thirty figures."""
        return [100.0]

    def placed(self, scales: np.ndarray) -> np.ndarray:
        """Return one figure in per cent of full scale as the matrix."""
        return self._of_full_scale(float(scales[0]) * self.si)

    def _of_full_scale(self, part: float) -> np.ndarray:
        """Cross-talk of ``part`` of each channel's full scale at the full scale of each other component."""
        raw = self.table.raw("full_scale")
        if not isinstance(raw, list) or len(raw) != 6:
            raise ExperimentError(f"{self.table.path('full_scale')} is {raw!r}: write six values, force then moment")
        full = np.array([self._item("full_scale", raw, (i,), unit) for i, unit in enumerate(WRENCH_UNITS)])
        return part * np.outer(above_zero(self.table, "full_scale", full), 1 / full) * (1 - np.eye(6))

    def _item(self, key: str, raw: Any, index: tuple[int, ...], unit: str) -> float:
        where = self.table.path(key) + "".join(f"[{i}]" for i in index)
        for i in index:
            raw = raw[i]
        try:
            return quantity(raw, unit) * (0.01 if unit == "%" else 1.0)
        except UnitError as error:
            raise ExperimentError(f"{where} {error}") from None
