"""Directions that a motion visited, and the uncertainty of the moment of inertia about each axis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from identify.results.run_estimate import RunEstimate

NEAR = np.deg2rad(15)
"""Angle within which a direction counts as visited [rad]."""
LARGE = 0.5
"""Part of the largest magnitude from which a sample counts."""
GRID = 2000
"""Directions over the whole sphere, on which axes are compared."""


@dataclass(frozen=True)
class AxisValues:
    """A figure of every axis through the body, and where it is least and largest."""

    directions: Float[np.ndarray, "n 3"]
    """Axes in B, one half of the sphere."""
    values: Float[np.ndarray, " n"]

    @property
    def least(self) -> tuple[np.ndarray, float]:
        """The axis of the least value, and this value."""
        k = int(np.argmin(self.values))
        return self.directions[k], float(self.values[k])

    @property
    def largest(self) -> tuple[np.ndarray, float]:
        """The axis of the largest value, and this value."""
        k = int(np.argmax(self.values))
        return self.directions[k], float(self.values[k])


def directions() -> Float[np.ndarray, "n 3"]:
    """Return axes spread evenly over the half of the sphere about b3 (Fibonacci's spiral)."""
    k = np.arange(GRID // 2)
    height = 1 - (k + 0.5) / len(k)
    angle = np.pi * (3 - np.sqrt(5)) * k
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def visited(path: Float[np.ndarray, "p 3"]) -> float:
    """Return the share of all axes within 15° of which the path comes with half its largest magnitude or more.

    Args:
        path: angular velocities or accelerations in B, in any unit.
    """
    size = np.linalg.norm(path, axis=1)
    fast = size >= LARGE * size.max(initial=0)
    if not size.max(initial=0) > 0:
        return 0.0
    closeness = np.abs(directions() @ (path[fast] / size[fast, None]).T).max(axis=1)
    return float(np.mean(closeness >= np.cos(NEAR)))


def rms_about(path: Float[np.ndarray, "p 3"]) -> AxisValues:
    """Return the root mean square of the path's component along every axis."""
    axes = directions()
    return AxisValues(axes, np.sqrt(np.einsum("ni,ij,nj->n", axes, path.T @ path / len(path), axes)))


def uncertainty_about(covariance: Float[np.ndarray, "6 6"]) -> AxisValues:
    """Return the standard uncertainty of the moment of inertia ``n·I·n`` about every axis n [kg·m²].

    Args:
        covariance: of the packed tensor [(kg·m²)²].
    """
    axes = directions()
    x, y, z = axes.T
    gradient = np.stack([x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z], axis=1)
    return AxisValues(axes, np.sqrt(np.einsum("ni,ij,nj->n", gradient, covariance, gradient)))


def motion(runs: Sequence[RunEstimate]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return angular velocity and acceleration of all runs [rad/s, rad/s²], thinned; None where no run has them."""
    traces = [run.trace for run in runs if run.trace is not None]
    if not traces:
        return None
    return np.concatenate([trace.omega for trace in traces]), np.concatenate([trace.alpha for trace in traces])
