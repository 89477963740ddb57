"""A recorded run as sums of a fixed size, in which constant errors are linear maps.

The recorded motion, differentiated and filtered as the estimator does it, is taken as the true one; the recorded force
and the fitted tensor make the true moment, ``M = r × F + Ω i``. Errors then act as in a simulated trial
(:mod:`uq.gram_sums.error_maps`), and the estimator is applied again. An offset that is estimated or taken from rest
cancels in sums about the means or about the rest, so that the sums of runs of one mounting add up.

Of generalised least squares the weights are held fixed: with ``H = W Omega_R``, what is estimated along eliminated, the
tensor of disturbed signals is ``(Hᵀ Omega_R')⁻¹ Hᵀ (M' - r' × F')``. Where no residual is left, as here, its derivative
by the errors is that of the estimate. H takes the place of the undisturbed elements in the sums.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.estimators.gram import Sums
from identify.estimators.offsets import resting
from identify.estimators.regressor_rows import unbroken, usable_rows
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, Array, library_of
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import apply
from identify.signals.gravity_direction import upward_by_force
from identify.signals.resample import uniform_spline
from identify.signals.residual_spectrum import Lines
from identify.signals.run import Run, RunError
from uq.gram_sums.case_equations import feature_map
from uq.gram_sums.error_maps import Columns, gyro_map
from uq.sources.constant_errors import Errors

ELEMENTS = 18
"""Number of elements of the true motion: 1, omega, its products, t, t omega, t², alpha."""
NODES = 7
"""Delays at which the sums are taken; between them they are interpolated by a polynomial."""
REACH = 5.0
"""Standard deviations of a delay that the nodes span."""
FEATURES = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 15, 16, 17])
"""Indices of the thirteen features among the elements."""


class WeightedSums(NamedTuple):
    """Weighted sums over the samples of one run, or of several of one mounting; the delays lead."""

    gram: Float[Array, "delays 18 18"]
    """Sums of products of the elements, or of the 3 × 6 numbers of H, with the elements."""
    wrench: Float[Array, "delays 18 columns"]
    """Sums of the same rows' products with the columns of :class:`uq.gram_sums.error_maps.Columns`."""


def delay_nodes(mean: float, sigma: float) -> np.ndarray:
    """Return the delays [s] at which sums are taken: Chebyshev's, no delay among what they span."""
    low, high = min(0.0, mean - REACH * sigma), max(0.0, mean + REACH * sigma)
    if low == high:
        return np.zeros(1)
    return (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * np.arange(NODES) / (NODES - 1))


def run_sums(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    columns: Columns,
    *,
    offsets: OffsetChoice,
    weight: float = 1.0,
    delays: Sequence[float] | np.ndarray = (0.0,),
    weighed: np.ndarray | None = None,
) -> WeightedSums:
    """Return a run's sums.

    Args:
        run: the run.
        estimator: its differentiator and filter.
        r_cg: centre of gravity from Q, in B [m].
        inertia: packed tensor about the centre of gravity [kg·m²].
        columns: functions of time that the measured wrench is made of.
        offsets: how constant offsets are removed.
        weight: of the run among others.
        delays: of the angular velocity, at which sums are taken [s].
        weighed: H on the first lines of the cosine transform, (k, 3, 6); None: ordinary least squares.

    Raises:
        RunError: the delays take more than half of the run.
    """
    lost = int(np.ceil(np.abs(delays).max() * run.rate))
    plain = elements_of(run, run.omega, estimator)
    keep = usable_rows(run, plain.shape[1])
    reached = (keep >= lost) & (keep < plain.shape[1] - lost)
    inside = keep[reached]
    if 2 * len(inside) < len(keep):
        raise RunError(
            f"a delay of up to {np.abs(delays).max():.3g} s is declared, which takes more than half of {run.name}: "
            "record for longer, or declare what is known of the delay"
        )
    span = slice(inside[0], inside[-1] + 1) if len(inside) == np.ptp(inside) + 1 else inside  # a slice copies nothing
    wrench = _columns(
        run=run, elements=plain, estimator=estimator, r_cg=r_cg, inertia=inertia, columns=columns, offsets=offsets
    )[:, span]
    if offsets == "estimate":
        wrench = wrench - wrench.mean(axis=1, keepdims=True)
    fixed = None
    if weighed is not None:
        fixed = Lines.of(unbroken(keep), run.rate).samples(weighed)[reached].reshape(-1, ELEMENTS).T
    spline = uniform_spline(run.omega, 1 / run.rate) if np.any(delays) else None
    gram, with_wrench = [], []
    for delay in delays:
        elements = plain[:, span]
        if spline is not None and delay != 0:
            shifted = spline(np.clip(run.t - delay, run.t[0], run.t[-1]) - run.t[0])
            elements = elements_of(run, shifted, estimator)[:, span]
        if offsets == "estimate":
            elements = elements - elements.mean(axis=1, keepdims=True)
        weighted_elements = elements if fixed is None else fixed
        gram.append(weighted_elements @ elements.T)
        with_wrench.append(weighted_elements @ wrench.T)
    return WeightedSums(weight * np.array(gram), weight * np.array(with_wrench))


def added(runs: Sequence[WeightedSums]) -> WeightedSums:
    """Return the sums of several runs together."""
    return WeightedSums(*(np.sum(parts, axis=0) for parts in zip(*runs, strict=True)))


def measured(
    sums: WeightedSums, errors: Errors, columns: Float[Array, "6 columns"], at: Float[Array, " delays"]
) -> Sums:
    """Return the sums of the signals of sensors with these errors.

    Args:
        sums: of the run.
        errors: constant errors.
        columns: what they make of the wrench, :meth:`uq.gram_sums.error_maps.Columns.map`.
        at: weights of the delays.
    """
    gram, wrench = _at_delay(sums, at)
    elements = _features(errors)
    both = elements @ (wrench @ columns.T) + (elements @ gram[:, 0])[:, None] * errors.cell_bias[None]
    return Sums(elements @ gram @ elements.T, both[:, :3], both[:, 3:])


def weighed_equations(
    sums: WeightedSums,
    errors: Errors,
    columns: Float[Array, "6 columns"],
    at: Float[Array, " delays"],
    r_cg: Float[Array, "3"],
) -> tuple[Float[Array, "6 6"], Float[Array, "6"]]:
    """Return ``Hᵀ Omega_R'`` and ``Hᵀ (M' - r' × F')`` of the signals of sensors with these errors.

    Args:
        sums: of the run, with H.
        errors: constant errors.
        columns: what they make of the wrench.
        at: weights of the delays.
        r_cg: believed centre of gravity, ``r'`` [m].
    """
    gram, wrench = _at_delay(sums, at)
    rows = (gram @ _features(errors).T).reshape(3, 6, -1)
    both = (wrench @ columns.T + gram[:, :1] * errors.cell_bias[None]).reshape(3, 6, 6)
    xp = library_of(both, r_cg)
    about_cg = both[..., 3:] - xp.cross(r_cg, both[..., :3])
    return library_of(rows).einsum("apk,kaq->pq", rows, OMEGA_R_OF_FEATURES), xp.einsum("apa->p", about_cg)


def _features(errors: Errors) -> Float[Array, "13 18"]:
    """Return the matrix that gives the features of the measured angular velocity from the elements of the true one."""
    return feature_map(gyro_map(errors), errors.gyro_bias, errors.gyro_drift)


def _at_delay(sums: WeightedSums, at: Float[Array, " delays"]) -> WeightedSums:
    """The sums at a delay, from those at the nodes."""
    xp = library_of(*sums, at)
    return WeightedSums(*(xp.tensordot(at, part, axes=1) for part in sums))


def delay_weights(nodes: Float[Array, " delays"], delay: Float[Array, ""]) -> Float[Array, " delays"]:
    """Return the weights of Lagrange's polynomial through the nodes, at a delay [s] within them."""
    if len(nodes) == 1:
        return np.ones(1)
    xp, same = library_of(nodes, delay), np.eye(len(nodes), dtype=bool)
    inside = xp.clip(delay, xp.min(nodes), xp.max(nodes))
    apart = xp.where(same, 1.0, nodes[:, None] - nodes[None])
    return xp.prod(xp.where(same, 1.0, (inside - nodes)[None] / apart), axis=1)


def elements_of(
    run: Run, omega: np.ndarray, estimator: EstimatorSpec, begin: float | None = None
) -> Float[np.ndarray, "18 m"]:
    """Return the elements of an angular velocity at the run's instants, with the estimator's derivative, filtered.

    Args:
        run: whose instants count.
        omega: angular velocity at them [rad/s].
        estimator: its differentiator and filter.
        begin: from when the elements' time counts [s]; None: from the run's first instant.
    """
    taps = estimator.taps(run.rate)
    alpha = apply(omega.T, np.concatenate([-taps[::-1], [0.0], taps])[::-1])
    inner = slice(len(taps), len(run.t) - len(taps))
    w, t = omega[inner].T, (run.t[inner] - (run.t[0] if begin is None else begin))[None]
    products = np.stack([w[i] * w[j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
    return smoothed(np.concatenate([np.ones_like(t), w, products, t, t * w, t * t, alpha]), run, estimator)


def smoothed(signals: Float[np.ndarray, "k n"], run: Run, estimator: EstimatorSpec) -> Float[np.ndarray, "k m"]:
    """Return signals through an estimator's filter."""
    taps = estimator.filter_taps(run.rate)
    return signals if len(taps) == 1 else apply(signals, taps)


def _columns(
    run: Run,
    elements: np.ndarray,
    estimator: EstimatorSpec,
    r_cg: np.ndarray,
    inertia: np.ndarray,
    columns: Columns,
    offsets: OffsetChoice,
) -> Float[np.ndarray, "columns m"]:
    """The fitted run's wrench, then the other functions of time, through the estimator's filter."""
    half = len(estimator.taps(run.rate))
    inner = slice(half, len(run.t) - half)
    force = smoothed(run.force[inner].T, run, estimator)
    if offsets == "still":
        force = force - resting(run).force[:, None]
    moment = np.cross(r_cg, force.T).T + (OMEGA_R_OF_FEATURES @ inertia).T @ elements[FEATURES]
    parts = [force, moment, *([elements[10:11]] if columns.time else [])]
    if columns.motion:
        up = smoothed(upward_by_force(run, r_cg)[inner].T, run, estimator)
        parts += [elements[4:10], elements[15:18], np.zeros((6, up.shape[1])), up]
    return np.concatenate(parts)
