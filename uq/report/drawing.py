"""Figures that are drawn when they are asked for, by a function of :mod:`uq.report.figures`."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from identify.reporting import Drawing

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


def drawing(name: str, caption: str, function: str, *arguments: Any) -> Drawing:
    """Return a figure whose module, and with it matplotlib, is imported when it is drawn.

    Args:
        name: stem of its files, unique in a result.
        caption: text below it.
        function: module in :mod:`uq.report.figures` and name, as ``budget.shares``.
        arguments: of the function.
    """
    module, _, draws = function.partition(".")

    def draw() -> "FigureBase":
        return getattr(import_module(f"uq.report.figures.{module}"), draws)(*arguments)

    return Drawing(name, caption, draw)
