"""A result with the least that one says."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from identify.display.reporting import Drawing, Result
from identify.display.text_tables import Table


@dataclass(frozen=True, repr=False)
class Weighed(Result):
    """A result with the least that one says."""

    mass: float
    spread: np.ndarray
    warnings: tuple[str, ...] = ()
    drawn: ClassVar[list[str]] = []

    def title(self):
        return "One <weighing>"

    def tables(self):
        return [Table("", ["", "kg"], [["mass", f"{self.mass:g}"]]), Table("long", ["a"], [["b"]], long=True)]

    def drawings(self):
        return [Drawing("mass", "How heavy.", lambda: self.drawn.append("mass") or Figure())]


def weighing():
    return Weighed(2.0, np.array([1.0, np.nan]), ("it moved",))
