"""Figures that are drawn when they are asked for, by a function of :mod:`uq.report.figures`."""

from functools import partial
from importlib import import_module
from typing import Any

from identify.display.reporting import Drawing
from uq.report.figures.style import STYLE


def drawing(name: str, caption: str, function: str, *arguments: Any, animation: str = "") -> Drawing:
    """Return a figure whose module, and with it matplotlib, is imported when it is drawn: in the style of all.

    Args:
        name: stem of its files, unique in a result.
        caption: text below it.
        function: module in :mod:`uq.report.figures` and name, as ``budget.shares``.
        arguments: of the function.
        animation: function of the same arguments that makes an SVG that moves; empty: the figure stands still.
    """

    def call(path: str) -> Any:
        from matplotlib import rc_context

        module, _, called = path.partition(".")
        with rc_context(STYLE):
            return getattr(import_module(f"uq.report.figures.{module}"), called)(*arguments)

    return Drawing(name, caption, partial(call, function), partial(call, animation) if animation else None)
