"""Figures that are drawn when they are asked for, by a function of :mod:`uq.report.figures`."""

from functools import partial
from importlib import import_module
from typing import Any

from identify.reporting import Drawing


def drawing(name: str, caption: str, function: str, *arguments: Any, animation: str = "") -> Drawing:
    """Return a figure whose module, and with it matplotlib, is imported when it is drawn.

    Args:
        name: stem of its files, unique in a result.
        caption: text below it.
        function: module in :mod:`uq.report.figures` and name, as ``budget.shares``.
        arguments: of the function.
        animation: function of the same arguments that makes an SVG that moves; empty: the figure stands still.
    """

    def call(path: str) -> Any:
        module, _, called = path.partition(".")
        return getattr(import_module(f"uq.report.figures.{module}"), called)(*arguments)

    return Drawing(name, caption, partial(call, function), partial(call, animation) if animation else None)
