"""A platform with its body in motion, projected for a drawing."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from identify.motion.stewart_platform import StewartPlatform
from identify.rigid_body.inertia import Body, unpack

AZIMUTH = np.radians(-62.0)
ELEVATION = np.radians(18.0)
"""Elevation from which the platform is seen [rad]."""
MARGIN = 0.06
FRAMES = 25
"""Drawn instants of the motion in each second."""


@dataclass(frozen=True)
class Scene:
    """A projected scene: positions in units of the drawing's width, instants first."""

    base: Float[np.ndarray, "6 2"]
    plate: Float[np.ndarray, "n 6 2"]
    corners: Float[np.ndarray, "n 8 2"]
    """Corners of the cuboid that has the body's mass and tensor."""
    centre: Float[np.ndarray, "n 2"]
    """Centre of gravity of the body."""
    seconds: float
    """Duration of the scene [s]."""


def scene(
    platform: StewartPlatform,
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
    groups = [np.asarray(platform.base)[None], to_a(np.asarray(platform.joints)), to_a(cuboid(body) + r_cg_from_omb),
             to_a(np.asarray(r_cg_from_omb)[None])]  # fmt: skip
    seen = [_projected(outline) for outline in groups]
    points = np.concatenate([outline.reshape(-1, 2) for outline in seen])
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (1 - 2 * MARGIN) / max((high - low).max(), 1e-9)
    base, plate, corners, centre = (0.5 + scale * (outline - (low + high) / 2) for outline in seen)
    return Scene(base=base[0], plate=plate, corners=corners, centre=centre[:, 0], seconds=seconds)


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
