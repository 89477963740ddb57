"""Cross-talk of the load cell: each channel reads a part of every other component."""

import math
from collections.abc import Sequence
from typing import Annotated, Any

import msgspec
import numpy as np

from rig.exceptions import quoted
from rig.toml_tables import WrongKeyError, read_value, written
from uq.files.schema import in_unit, quantity_schema
from uq.sources.draw_figures import DrawFigures, part_of
from uq.sources.source import ErrorKind

WRENCH_UNITS = ("N", "N", "N", "N*m", "N*m", "N*m")
RELATIVE = {("N", "N"): "%", ("N*m", "N*m"): "%", ("N", "N*m"): "N/(N*m)", ("N*m", "N"): "N*m/N"}
UNITS = [[RELATIVE[channel, component] for component in WRENCH_UNITS] for channel in WRENCH_UNITS]
"""Unit of cross-talk, of a channel from a component."""


def _row(path: str, raw: Any, units: Sequence[str], **bounds: int | float) -> np.ndarray:
    """Figures in SI, each in its unit."""
    hints = [Annotated[float, in_unit(unit, **bounds)] for unit in units]
    values = [read_value(f"{path}[{i}]", item, hint) for i, (item, hint) in enumerate(zip(raw, hints, strict=True))]
    return np.array([value * part_of(unit) for value, unit in zip(values, units, strict=True)])


class CrossTalkFigures(DrawFigures):
    """A matrix with its units, or one figure in per cent of full scale, of shape ()."""

    def annotation(self, *, least: float | int = -math.inf) -> msgspec.Meta:
        """Return the annotation of a matrix with its units; or of one figure in per cent of full scale, shape ()."""

        def read(path: str, raw: Any) -> np.ndarray:
            if isinstance(raw, str):
                return np.array(read_value(path, raw, Annotated[float, in_unit("%", least=least)]) * 0.01)
            if not isinstance(raw, list) or [len(row) for row in raw if isinstance(row, list)] != [6] * 6:
                raise ValueError(f"is {quoted(raw)}: write six rows of six values, or one in %")
            return np.array([_row(f"{path}[{i}]", raw[i], UNITS[i], least=least) for i in range(6)])

        row = {"type": "array", "items": {"type": "string"}, "minItems": 6, "maxItems": 6}
        return written(
            read, {"anyOf": [quantity_schema("%"), {"type": "array", "items": row, "minItems": 6, "maxItems": 6}]}
        )

    def full_scale(self) -> msgspec.Meta:
        """Return the annotation of the six channels' full scale."""

        def read(path: str, raw: Any) -> np.ndarray:
            if not isinstance(raw, list) or len(raw) != 6:
                raise ValueError(f"is {quoted(raw)}: write six values, force then moment")
            return _row(path, raw, WRENCH_UNITS, above=0)

        return written(read, {"type": "array", "items": {"type": "string"}, "minItems": 6, "maxItems": 6})

    def wholes(self, full_scale: np.ndarray | None) -> list[float | None]:
        """Return that one statement, in per cent, is for all thirty figures."""
        return [100.0]

    def placed(self, figure: np.ndarray, full_scale: np.ndarray | None) -> np.ndarray:
        """Return the matrix; of one figure, that part of each channel's full scale at each other component's."""
        if figure.shape == self.shape:
            return figure
        if full_scale is None:
            raise WrongKeyError("full_scale", "add it")
        return float(figure.reshape(())) * np.outer(full_scale, 1 / full_scale) * (1 - np.eye(6))


class CrossTalk(ErrorKind):
    """Adds X w to the wrench w = (F, M), X a 6×6 matrix."""

    name = "cross_talk"
    targets = {"wrench": "%"}
    absence = "the {} has no cross-talk"
    shape = (6, 6)
    perturbs = {"wrench": "cell_cross_talk"}
    written_as = CrossTalkFigures
