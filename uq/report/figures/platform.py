"""A platform with its body in motion, seen from the side: a drawing that moves by itself, and one that stands still.

The moving one is an SVG whose lines are animated by SVG's own means (SMIL): it needs no script and loads nothing, plays
inside a picture, and prints as it stands.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import FigureBase

from uq.report.figures.platform_scene import Scene
from uq.report.figures.style import COLUMN, PALETTE, new_figure

SIZE = 460
"""Width and height of the drawing [px]."""
EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1)
"""Pairs of a cuboid's corners that an edge joins; corners numbered by their signs."""


def moving(view: Scene) -> bytes:
    """Return the drawing that moves, as SVG."""
    return "\n".join(_lines(view)).encode()


def _lines(view: Scene) -> Iterator[str]:
    legs = [_path(zip(view.base, plate, strict=True)) for plate in view.plate]
    plates = [_path([plate], closed=True) for plate in view.plate]
    boxes = [_path((corners[a], corners[b]) for a, b in EDGES) for corners in view.corners]
    yield (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}" width="{SIZE}" height="{SIZE}" '
           'role="img" stroke-linejoin="round" stroke-linecap="round">')  # fmt: skip
    yield f'<path d="{_path([view.base], closed=True)}" fill="#ececec" stroke="{PALETTE[7]}" stroke-width="2"/>'
    yield _animated(legs, view.seconds, f'fill="none" stroke="{PALETTE[1]}" stroke-width="4"')
    yield _animated(
        plates, view.seconds, f'fill="{PALETTE[2]}" fill-opacity="0.35" stroke="{PALETTE[2]}" stroke-width="2"'
    )
    yield _animated(boxes, view.seconds, f'fill="none" stroke="{PALETTE[0]}" stroke-width="1.5"')
    x, y = view.centre.T * SIZE
    values = [";".join(f"{value:.1f}" for value in places) for places in (x, y)]
    moves = "".join(_animate(name, text, view.seconds) for name, text in zip(("cx", "cy"), values, strict=True))
    yield f'<circle cx="{x[0]:.1f}" cy="{y[0]:.1f}" r="4" fill="{PALETTE[6]}">{moves}</circle>'
    yield "</svg>"


def _path(lines: Any, *, closed: bool = False) -> str:
    """Path data of polygons or polylines."""
    end = "Z" if closed else ""
    return "".join("M" + "L".join(f"{SIZE * x:.1f},{SIZE * y:.1f}" for x, y in line) + end for line in lines)


def _animated(paths: Sequence[str], seconds: float, style: str) -> str:
    return f'<path d="{paths[0]}" {style}>{_animate("d", ";".join(paths), seconds)}</path>'


def _animate(name: str, values: str, seconds: float) -> str:
    return f'<animate attributeName="{name}" dur="{seconds:g}s" repeatCount="indefinite" values="{values}"/>'


def still(view: Scene) -> FigureBase:
    """Return the drawing's first instant as a figure."""
    figure = new_figure(COLUMN, COLUMN)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(1, 0), aspect="equal")
    axes.fill(*view.base.T, facecolor="#ececec", edgecolor=PALETTE[7], linewidth=1)
    for foot, head in zip(view.base, view.plate[0], strict=True):
        axes.plot(*np.array([foot, head]).T, color=PALETTE[1], linewidth=2)
    axes.fill(*view.plate[0].T, facecolor=PALETTE[2], edgecolor=PALETTE[2], alpha=0.4, linewidth=1)
    for a, b in EDGES:
        axes.plot(*view.corners[0][[a, b]].T, color=PALETTE[0], linewidth=0.9)
    axes.plot(*view.centre[0], "o", color=PALETTE[6], markersize=3)
    return figure
