"""A platform with its body in motion, seen from the side: a drawing that moves by itself, and one that stands still.

The moving one is an SVG whose lines are animated by SVG's own means (SMIL): it needs no script and loads nothing, plays
inside a picture, and prints as it stands.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from identify.inertia import Body, unpack
from identify.platform import Platform
from uq.plots import COLUMN, PALETTE, STYLE

AZIMUTH, ELEVATION = np.radians(-62.0), np.radians(18.0)
"""Where it is seen from."""
SIZE = 460
"""Width and height of the drawing [px]."""
MARGIN = 0.06
FRAMES = 25
"""A second."""
EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if bin(a ^ b).count("1") == 1)
"""Pairs of a cuboid's corners that an edge joins; corners numbered by their signs."""


@dataclass(frozen=True)
class Scene:
    """What is drawn, projected: places in units of the drawing's width, instants first."""

    base: Float[np.ndarray, "6 2"]
    plate: Float[np.ndarray, "n 6 2"]
    corners: Float[np.ndarray, "n 8 2"]
    """Of the cuboid that has the body's mass and tensor."""
    centre: Float[np.ndarray, "n 2"]
    """Centre of gravity."""
    seconds: float
    """How long the instants last."""


def scene(
    platform: Platform,
    body: Body,
    r_cg_from_omb: np.ndarray,
    position: Float[np.ndarray, "n 3"],
    rotation: Float[np.ndarray, "n 3 3"],
    seconds: float,
) -> Scene:
    """Return a motion as it is drawn.

    Args:
        platform: geometry.
        body: mass and tensor of the body.
        r_cg_from_omb: its centre of gravity from the platform's centre, in B [m].
        position: of the platform's centre, in A [m].
        rotation: R_AB.
        seconds: how long the motion lasts [s].
    """
    to_a = lambda points: position[:, None] + np.einsum("nij,kj->nki", rotation, points)  # noqa: E731
    parts = [np.asarray(platform.base)[None], to_a(np.asarray(platform.joints)), to_a(cuboid(body) + r_cg_from_omb),
             to_a(np.asarray(r_cg_from_omb)[None])]  # fmt: skip
    seen = [_projected(part) for part in parts]
    every = np.concatenate([part.reshape(-1, 2) for part in seen])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = (1 - 2 * MARGIN) / max((high - low).max(), 1e-9)
    base, plate, corners, centre = (0.5 + scale * (part - (low + high) / 2) for part in seen)
    return Scene(base[0], plate, corners, centre[:, 0], seconds)


def cuboid(body: Body) -> Float[np.ndarray, "8 3"]:
    """Return the corners, from the centre of gravity, of the cuboid of the body's mass and tensor."""
    moments, axes = np.linalg.eigh(np.asarray(unpack(body.inertia)))
    square = 6 * (moments.sum() - 2 * moments) / float(body.mass)
    half = np.sqrt(np.maximum(square, 1e-6)) / 2
    signs = np.array([[1 if number >> k & 1 else -1 for k in range(3)] for number in range(8)])
    return (signs * half) @ axes.T


def _projected(points: np.ndarray) -> np.ndarray:
    """Places on the drawing, right and down."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    up = np.array([-np.sin(ELEVATION) * np.cos(AZIMUTH), -np.sin(ELEVATION) * np.sin(AZIMUTH), np.cos(ELEVATION)])
    return np.stack([points @ right, -points @ up], axis=-1)


def moving(of: Scene) -> bytes:
    """Return the drawing that moves, as SVG."""
    return "\n".join(_lines(of)).encode()


def _lines(of: Scene) -> Iterator[str]:
    legs = [_path(zip(of.base, plate, strict=True)) for plate in of.plate]
    plates = [_path([plate], closed=True) for plate in of.plate]
    boxes = [_path((corners[a], corners[b]) for a, b in EDGES) for corners in of.corners]
    yield (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}" width="{SIZE}" height="{SIZE}" '
           'role="img" stroke-linejoin="round" stroke-linecap="round">')  # fmt: skip
    yield f'<path d="{_path([of.base], closed=True)}" fill="#ececec" stroke="{PALETTE[7]}" stroke-width="2"/>'
    yield _animated(legs, of.seconds, f'fill="none" stroke="{PALETTE[1]}" stroke-width="4"')
    yield _animated(
        plates, of.seconds, f'fill="{PALETTE[2]}" fill-opacity="0.35" stroke="{PALETTE[2]}" stroke-width="2"'
    )
    yield _animated(boxes, of.seconds, f'fill="none" stroke="{PALETTE[0]}" stroke-width="1.5"')
    x, y = of.centre.T * SIZE
    values = [";".join(f"{value:.1f}" for value in part) for part in (x, y)]
    moves = "".join(_animate(name, text, of.seconds) for name, text in zip(("cx", "cy"), values, strict=True))
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


def still(of: Scene) -> Figure:
    """Return the drawing's first instant as a figure."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, COLUMN))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set(xlim=(0, 1), ylim=(1, 0), aspect="equal")
        axes.fill(*of.base.T, facecolor="#ececec", edgecolor=PALETTE[7], linewidth=1)
        for foot, head in zip(of.base, of.plate[0], strict=True):
            axes.plot(*np.array([foot, head]).T, color=PALETTE[1], linewidth=2)
        axes.fill(*of.plate[0].T, facecolor=PALETTE[2], edgecolor=PALETTE[2], alpha=0.4, linewidth=1)
        for a, b in EDGES:
            axes.plot(*of.corners[0][[a, b]].T, color=PALETTE[0], linewidth=0.9)
        axes.plot(*of.centre[0], "o", color=PALETTE[6], markersize=3)
    return figure
