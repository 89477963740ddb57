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
the tensors with ``Σ ⪰ 0`` at a distance ``Q`` from the data of at most ``q`` are a convex set. The nearest one and the
set's ends along a component are cone programmes, which Clarabel solves by an interior-point method (Goulart and Chen
2024, doi:10.48550/arXiv.2405.12762).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
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
EXACT = 1e-6
"""Standard uncertainty of what is exact, over the tensor's size."""
INSIDE = 1e-12
"""Least second moment of the nearest body, over the data's size: the solver stops a little outside at times."""
SMALLEST = 1e-6
"""Weight of the trace of Σ beside Q: where the data leave the nearest tensor open, it is the smallest."""


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
    """Return the tensor of a body that is nearest to the data, up to 1e-4 in Q.

    Raises:
        ValueError: none is found, as of numbers that are not finite.
    """
    bodies = _Bodies.of(data)
    tensor = bodies.least(SMALLEST * np.trace(SECOND_MOMENT, axis1=1, axis2=2), within=None)
    if tensor is None:
        raise ValueError("Argument `data` must be of a tensor, but no body is nearest to it.")
    moments, axes = np.linalg.eigh(second_moment(tensor))
    return of_second_moment(axes * np.maximum(moments, INSIDE * bodies.size) @ axes.T)


def ends(data: Data, most: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6 2"]:
    """Return the least and the largest value of each component among bodies with Q of at most ``most``; or infinity."""
    scale, bodies = size(data), _Bodies.of(data)
    values = np.array([[-np.inf, np.inf]] * 6)
    for k, q in enumerate(most):
        for end, sign in enumerate((1, -1)):
            tensor = bodies.least(sign * np.eye(6)[k], within=float(np.sqrt(q)))
            if tensor is not None and abs(tensor[k]) < 0.05 * LARGEST * scale:
                values[k, end] = tensor[k]
    values[list(MOMENTS)] = np.maximum(values[list(MOMENTS)], 0)
    return values


def size(data: Data) -> float:
    """Return the trace of Σ's positive part of the estimate [kg·m²]; where little is positive, a hundredth of all."""
    moments = np.linalg.eigvalsh(second_moment(data.estimate))
    return float(max(moments.clip(0).sum(), 0.01 * np.abs(moments).sum(), 1e-30))


@dataclass(frozen=True)
class _Bodies:
    """The tensors of bodies, ``size (centre + steps u)`` of six numbers u, in a programme of well-scaled numbers."""

    size: float
    centre: Float[np.ndarray, "6"]
    """The estimate, over the size."""
    steps: Float[np.ndarray, "6 6"]
    """Changes of a tensor: of one standard uncertainty each, or of the size where the data add nothing."""
    bounded: np.ndarray
    """Mask of the steps of which the data know something, (6,): Q is the sum of the squares of their numbers."""

    @classmethod
    def of(cls, data: Data) -> "_Bodies":
        """Take the principal axes of the data's information."""
        scale = size(data)
        values, vectors = np.linalg.eigh(data.information * scale**2)
        bounded = values > 1e-13 * values[-1]
        return cls(scale, data.estimate / scale, vectors / np.sqrt(np.where(bounded, values, 1.0)), bounded)

    def least(self, direction: Float[np.ndarray, "6"], within: float | None) -> Float[np.ndarray, "6"] | None:
        """Return the tensor that reaches least far along a direction; None where the solver finds none.

        Args:
            direction: in the space of packed tensors.
            within: largest ``sqrt Q``; None: half of Q is added to what is to be least.
        """
        (rows, spare), slope, curvature = self._body, direction @ self.steps, np.diag(self.bounded.astype(float))
        if within is not None:
            ball = np.vstack([np.zeros(6), np.eye(6)[self.bounded]])
            rows, spare = np.vstack([rows, ball]), np.concatenate([spare, [within], np.zeros(len(ball) - 1)])
            slope, curvature = slope / np.linalg.norm(slope), np.zeros((6, 6))
        numbers = _solved(curvature, slope, rows, spare)
        return None if numbers is None else self.size * (self.centre + self.steps @ numbers)

    @cached_property
    def _body(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and constants of what is not negative of a body: its spare trace, and Σ as a matrix.

        Σ is turned to the estimate's principal axes, each of them stretched to one: a thin body is as round as others.
        """
        moments, changes = second_moment(self.centre), np.tensordot(self.steps.T, SECOND_MOMENT, axes=1)
        values, axes = np.linalg.eigh(moments)
        axes = axes / np.sqrt(np.maximum(np.abs(values), EXACT))
        matrices = axes.T @ np.concatenate([changes, moments[None]]) @ axes
        traces = np.append(-changes.trace(axis1=1, axis2=2), LARGEST - moments.trace()) / LARGEST
        rows = np.column_stack([traces, matrices[:, _ROWS, _COLUMNS] * _WEIGHTS]).T
        return rows[:, :6], rows[:, 6]


def _solved(curvature: np.ndarray, slope: np.ndarray, rows: np.ndarray, spare: np.ndarray) -> np.ndarray | None:
    """The numbers u of least ``½ uᵀ curvature u + slope · u``; None where the solver does not converge.

    Of ``rows u + spare`` the first is not negative, six are a positive semidefinite matrix, and if there are more, the
    first of these is at least the norm of the others.
    """
    import clarabel  # which only weak data need
    from scipy import sparse

    cones = [clarabel.NonnegativeConeT(1), clarabel.PSDTriangleConeT(3)]
    if len(rows) > 7:
        cones.append(clarabel.SecondOrderConeT(len(rows) - 7))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for scales in (False, True):  # the numbers are well scaled: its own scaling stalls more often, on other bodies
        settings.equilibrate_enable = scales
        matrices = sparse.csc_matrix(curvature), slope, sparse.csc_matrix(-rows)
        solution = clarabel.DefaultSolver(*matrices, spare, cones, settings).solve()
        if solution.status in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return np.array(solution.x)
    return None


_ROWS, _COLUMNS = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])
_WEIGHTS = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2))
"""Σ's upper triangle by columns, so weighted that its scalar product is that of matrices."""

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
    return covariance + (EXACT * np.abs(inertia).max()) ** 2 * np.eye(6)


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
