"""The nearest tensor that a body can have, the range of each component among bodies, and what this adds to weak data.

The fit is over the free numbers of :mod:`identify.rigid_body.pseudo_inertia`, so it cannot leave what is possible.
Where the plain estimate lies well inside, nothing is done: bounds would bias what they need not touch. Where it lies
outside or within three standard uncertainties of the edge, or the motion says nothing of a component, the interval of a
component is its range over all bodies whose distance ``Q`` from the data exceeds the least one by no more than k², k
the coverage factor (Batlle, Patil, Stanley, Kuusela and Owhadi 2023, doi:10.48550/arXiv.2310.02461): the plain interval
far from the edge; never empty, and never short for the reason that the estimate fell outside. Where a moment itself may
vanish, as a needle's does, two bounds meet and that range is too short: it reaches down to the plain interval's end.

A body's second moments ``Σ = ½ tr(I) 1 - I`` are positive semidefinite and linear in the tensor, which is positive
definite and obeys the triangle inequality just then (Wensing, Kim and Slotine 2018, doi:10.1109/LRA.2017.2729659). So
the tensors with ``Σ ⪰ 0`` at a distance ``Q`` from the data of at most ``q`` are a convex set, and its end along any
component is found by Newton steps behind logarithmic barriers (Boyd and Vandenberghe 2004, 11.3).
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.display.reporting import plain
from identify.rigid_body.inertia import COMPONENTS, MOMENTS
from identify.rigid_body.pseudo_inertia import SECOND_MOMENT, free_of, log_cholesky, of_second_moment, second_moment

LARGEST = 1e4
"""Trace of Σ, over that of the data, beyond which a component counts as unbounded."""
BARRIERS = 5.0
"""Parameter of the barriers together: over the weight of the aim, it bounds what is missing to the end."""
ROUNDING = 1e-13
"""Multiple of the unit matrix that is added to a Hessian of unit diagonal against rounding errors."""
SHARPEST = 1e11
"""Last weight of the aim against the barriers."""


class Data(NamedTuple):
    """The data's information on a tensor: ``Q(i) = (i - estimate)ᵀ information (i - estimate)``."""

    estimate: Float[np.ndarray, "6"]
    information: Float[np.ndarray, "6 6"]
    """Inverse covariance, zero where the data add nothing."""

    def distance(self, inertia: Float[np.ndarray, "6"]) -> float:
        """Return the distance Q of a tensor from the data."""
        difference = inertia - self.estimate
        return float(difference @ self.information @ difference)


def nearest(data: Data) -> Float[np.ndarray, "6"]:
    """Return the tensor of a body that is nearest to the data, up to 1e-4 in Q."""
    scale = size(data)
    scaled = Data(data.estimate / scale, data.information * scale**2)
    x = of_second_moment(np.eye(3) / 3)
    for weight in 10.0 ** np.arange(0, 6):
        x = _newton(_sum(_quadratic(scaled, weight), _bodies), x)
    return scale * x


def ends(data: Data, most: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6 2"]:
    """Return the least and the largest value of each component among bodies with Q of at most ``most``; or infinity."""
    scale = size(data)
    scaled, start = Data(data.estimate / scale, data.information * scale**2), nearest(data) / scale
    extremes = np.array(
        [[_farthest(scaled, s * unit, start, q) for s in (-1, 1)] for unit, q in zip(np.eye(6), most, strict=True)]
    )
    values = extremes * [-1, 1]
    values[list(MOMENTS)] = np.maximum(values[list(MOMENTS)], 0)
    return np.where(np.abs(values) > 0.05 * LARGEST, np.copysign(np.inf, values), scale * values)


def size(data: Data) -> float:
    """Return the trace of the positive part of Σ of the estimate [kg·m²]."""
    return float(max(np.linalg.eigvalsh(second_moment(data.estimate)).clip(0).sum(), 1e-30))


def _farthest(data: Data, direction: np.ndarray, start: np.ndarray, most: float) -> float:
    """The largest value along a direction, rounded up by no more than a thousandth of the way there or of the size."""
    x, weight, way = start, 1.0, 0.0
    while BARRIERS / weight > 1e-3 * min(way, 1.0) and weight < SHARPEST:
        weight *= 30
        x = _newton(_sum(_linear(-weight * direction), _bodies, _within(data, most)), x)
        way = float(direction @ (x - start))
    return float(direction @ x) + BARRIERS / weight


_FLAT, _TRACE = SECOND_MOMENT.reshape(6, 9), np.trace(SECOND_MOMENT, axis1=1, axis2=2)

Function = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""Value, gradient and Hessian at a tensor; infinite outside."""


def _sum(*functions: Function) -> Function:
    def total(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        values, gradients, hessians = zip(*(function(x) for function in functions), strict=True)
        return sum(values), sum(gradients), sum(hessians)

    return total


def _linear(slope: np.ndarray) -> Function:
    return lambda x: (float(slope @ x), slope, np.zeros((6, 6)))


def _quadratic(data: Data, weight: float) -> Function:
    half = weight * data.information
    return lambda x: (0.5 * weight * data.distance(x), half @ (x - data.estimate), half)


def _within(data: Data, most: float) -> Function:
    """Return the barrier ``-log(most - Q)`` as a function with its derivatives."""

    def barrier(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        slack = most - data.distance(x)
        if slack <= 0:
            return np.inf, np.zeros(6), np.zeros((6, 6))
        slope = 2 * data.information @ (x - data.estimate) / slack
        return -np.log(slack), slope, 2 * data.information / slack + np.outer(slope, slope)

    return barrier


def _bodies(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """``-log det Σ - log(LARGEST - tr Σ)``."""
    flat = x @ _FLAT
    slack = LARGEST - float(x @ _TRACE)
    corner = flat[0] * flat[4] - flat[1] * flat[3]
    moments = flat.reshape(3, 3)
    if slack <= 0 or flat[0] <= 0 or corner <= 0 or (determinant := float(np.linalg.det(moments))) <= 0:
        return np.inf, np.zeros(6), np.zeros((6, 6))
    trace_slope = _TRACE / slack
    solved = np.linalg.inv(moments) @ SECOND_MOMENT
    slope = trace_slope - np.trace(solved, axis1=1, axis2=2)
    crossed = solved.reshape(6, 9) @ solved.transpose(0, 2, 1).reshape(6, 9).T
    return -math.log(determinant) - math.log(slack), slope, np.outer(trace_slope, trace_slope) + crossed


def _newton(function: Function, x: np.ndarray) -> np.ndarray:
    """The minimum of a self-concordant function, by Newton steps."""
    value, slope, curvature = function(x)
    for _ in range(100):
        scale = 1 / np.sqrt(np.diag(curvature))
        step = -scale * np.linalg.solve(curvature * np.outer(scale, scale) + ROUNDING * np.eye(6), scale * slope)
        decrement = -float(slope @ step)
        if decrement < 1e-4:
            break
        length, rounding = 1.0, 1e-13 * abs(value)
        while not (new := function(x + length * step))[0] <= value - 0.1 * length * decrement + rounding:
            length /= 2
            if length < 1e-12:
                return x
        x, (value, slope, curvature) = x + length * step, new
    return x


NEAR = 3.0
"""Standard uncertainties from the edge below which bounds matter."""
UNUSUAL = 2.6
"""Standard uncertainties from any body beyond which that is worth a warning.

Chance: one in 200 for a body at the edge, such as a flat plate, whose plain estimate lies outside in every second run.
"""
CONTRADICTED = 4.0
"""Standard uncertainties from any body beyond which the data are wrong, not weak."""
ROUNDNESS = 0.02
"""Weight of a round body in the fit: it moves it by less than a twentieth of its standard uncertainty."""


class Admissible(NamedTuple):
    """The estimate within physical bodies, beside the plain estimate from the data."""

    inertia: Float[np.ndarray, "6"]
    """Packed tensor of a physical body [kg·m²]; where the data leave it open, that of the roundest body."""
    interval95: Float[np.ndarray, "6 2"]
    """Interval of 95 % of each component [kg·m²]; infinite where nothing bounds it."""
    determined: np.ndarray
    """Mask of the components that the motion determines, (6,)."""
    plain: Float[np.ndarray, "6"]
    """Packed tensor of the plain estimate [kg·m²]; zero along what the motion does not excite."""
    plain_interval95: Float[np.ndarray, "6 2"]
    """Interval of 95 % of each component of the plain estimate [kg·m²]; NaN where the motion does not determine it."""
    reason: str
    """Reason for the estimate within physical bodies, in words."""
    distance: float
    """Distance from the plain estimate to the nearest body, in standard uncertainties (Mahalanobis); 0: it is a
    body's."""

    @property
    def moved(self) -> bool:
        """Whether the estimate differs from the plain one."""
        return bool((self.inertia != self.plain).any())

    @property
    def note(self) -> str | None:
        """Note on intervals, or a value, that the limits of a body change; None where a warning says it."""
        if not self.determined.all() or self.distance > UNUSUAL:
            return None
        value = "that of the nearest body" if self.moved else "unchanged"
        return f"{self.reason}; intervals are cut to possible tensors, the value is {value}"

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it; what is infinite or unknown is None."""
        return {
            "reason": self.reason,
            "distance": self.distance,
            "determined": dict(zip(COMPONENTS, map(bool, self.determined), strict=True)),
            "plain_inertia": dict(zip(COMPONENTS, map(float, self.plain), strict=True)),
            "plain_interval95": dict(zip(COMPONENTS, plain(self.plain_interval95), strict=True)),
        }


def fit(
    body: Callable[[Float[Array, " p"]], Float[Array, " p"]],
    estimate: Float[np.ndarray, " p"],
    information: Float[np.ndarray, "p p"],
    start: Float[np.ndarray, " p"],
) -> Float[np.ndarray, " p"]:
    """Return the parameters of the body nearest to an estimate.

    Least ``½ (b - b̂)ᵀ W (b - b̂) + w (3 log(tr Σ / 3) - log det Σ)`` over the free numbers: the second term, zero for
    a round body, keeps off the edge and chooses where the data do not. BFGS, in the metric of the start.

    Args:
        body: :func:`log_cholesky` or :func:`pseudo_inertia`.
        estimate: the plain estimate of what ``body`` returns; its last six are the tensor.
        information: inverse of its covariance, zero where the data add nothing.
        start: free numbers to start from.

    Raises:
        ValueError: the fit does not converge.
    """
    with jax.enable_x64(True):
        arrays = tuple(jnp.asarray(np.asarray(array, np.float64)) for array in (estimate, information, start))
        free, converged = _fit(body, *arrays)
        if not bool(converged):
            raise ValueError("Argument `estimate` must be near a possible tensor, but the fit did not converge.")
        return np.asarray(body(free))


@partial(jax.jit, static_argnames="body")
def _fit(body: Callable[[Array], Array], estimate: Array, information: Array, start: Array) -> tuple[Array, Array]:
    import optimistix  # a fifth of a second, which few results need

    def cost(free: Array) -> Array:
        difference = body(free) - estimate
        return 0.5 * difference @ information @ difference + ROUNDNESS * roundness(body(free)[-6:])

    slope = jax.jacobian(body)(start)
    metric = slope.T @ information @ slope + ROUNDNESS * jnp.eye(len(start), dtype=start.dtype)
    scale = 1 / jnp.sqrt(jnp.diag(metric))
    root = jnp.linalg.cholesky(metric * jnp.outer(scale, scale))
    to_free = lambda z: start + scale * jax.scipy.linalg.solve_triangular(root.T, z)  # noqa: E731
    solver: Any = optimistix.BFGS(rtol=1e-9, atol=1e-7)
    solution: Any = optimistix.minimise(
        lambda z, _: cost(to_free(z)), solver, jnp.zeros_like(start), max_steps=2000, throw=False
    )
    return to_free(solution.value), jnp.asarray(solution.result == optimistix.RESULTS.successful)


def roundness(inertia: Float[Array, "6"]) -> Float[Array, ""]:
    """Return ``3 log(tr Σ / 3) - log det Σ``: zero for a body with equal moments, infinite for a flat one."""
    moments = jnp.tensordot(inertia, jnp.asarray(SECOND_MOMENT, inertia.dtype), axes=1)
    return 3 * jnp.log(jnp.trace(moments) / 3) - jnp.linalg.slogdet(moments)[1]


def margin(inertia: Float[np.ndarray, "6"], covariance: Float[np.ndarray, "6 6"]) -> float:
    """Return how many standard uncertainties a tensor lies inside what bodies have; negative outside."""
    values, vectors = np.linalg.eigh(second_moment(inertia))
    slopes = np.einsum("ak,iab,bk->ki", vectors, SECOND_MOMENT, vectors)
    spread = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", slopes, covariance, slopes), 1e-300))
    return float((values / spread).min())


def distance_from_bodies(inertia: Float[np.ndarray, "6"], covariance: Float[np.ndarray, "6 6"]) -> float:
    """Return how far the nearest body is, ``sqrt Q`` in standard uncertainties (Mahalanobis); 0 for a body's tensor.

    Args:
        inertia: a tensor [kg·m²].
        covariance: of it [(kg·m²)²]; a millionth of the tensor's size is added to what is exact.
    """
    if np.linalg.eigvalsh(second_moment(inertia)).min() >= 0:
        return 0.0
    data = _data(inertia, _not_exact(inertia, covariance), np.eye(6))
    return float(np.sqrt(max(data.distance(nearest(data)), 0.0)))


def _not_exact(inertia: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    return covariance + (1e-6 * np.abs(inertia).max()) ** 2 * np.eye(6)


def _data(inertia: np.ndarray, covariance: np.ndarray, seen: np.ndarray) -> Data:
    return Data(inertia, seen.T @ np.linalg.inv(seen @ covariance @ seen.T) @ seen)


def admissible(
    inertia: Float[np.ndarray, "6"],
    covariance: Float[np.ndarray, "6 6"],
    coverage_factor: Float[np.ndarray, "6"],
    seen: Float[np.ndarray, "k 6"] | None = None,
) -> Admissible | None:
    """Return the tensor and the intervals that bodies allow; None where the data alone are strong enough, or wrong.

    Args:
        inertia: the plain estimate [kg·m²].
        covariance: of it [(kg·m²)²].
        coverage_factor: of its intervals, by component.
        seen: orthonormal directions in the space of packed tensors that the data determine; None: all.
    """
    seen = np.eye(6) if seen is None else seen
    covariance = _not_exact(inertia, covariance)
    inside = margin(inertia, covariance)
    if len(seen) == 6 and inside >= NEAR:
        return None
    data = _data(inertia, covariance, seen)
    closest = nearest(data)
    least = data.distance(closest)
    if least > CONTRADICTED**2:
        return None
    determined = np.abs(seen.T @ seen - np.eye(6)).max(axis=1) < 1e-3
    half = np.where(determined, coverage_factor * np.sqrt(np.diag(covariance)), np.nan)
    plain = np.stack([inertia - half, inertia + half], axis=1)
    well_inside = len(seen) == 6 and inside > 0
    value = inertia if well_inside else _rounded(data, closest)
    interval = ends(data, least + coverage_factor**2)
    interval[MOMENTS, 0] = np.fmin(interval[MOMENTS, 0], np.maximum(plain[MOMENTS, 0], 0))
    distance = 0.0 if well_inside else float(np.sqrt(max(least, 0.0)))
    return Admissible(
        inertia=value, interval95=interval, determined=determined, plain=inertia, plain_interval95=plain,
        reason=_reason(determined, inside), distance=distance,
    )  # fmt: skip


def _rounded(data: Data, closest: np.ndarray) -> np.ndarray:
    """The body of :func:`fit`; where that does not converge, as of figures that are nearly exact, the nearest one."""
    try:
        return fit(log_cholesky, data.estimate, data.information, free_of(_inner(data)))
    except ValueError:
        return closest


def _inner(data: Data) -> np.ndarray:
    """A body near the estimate, clear of the edge."""
    values, vectors = np.linalg.eigh(second_moment(data.estimate))
    return of_second_moment(vectors @ np.diag(np.maximum(values, 0.02 * size(data))) @ vectors.T)


def _reason(determined: np.ndarray, inside: float) -> str:
    if not determined.all():
        return "the motion does not determine every component"
    if inside <= 0:
        return f"the estimate is physically impossible by {-inside:.1f} standard uncertainties"
    return f"the estimate is {inside:.1f} standard uncertainties from physically impossible"
