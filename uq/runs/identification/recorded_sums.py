"""A recorded run as sums of a fixed size, in which constant errors are linear maps.

The recorded motion, differentiated and filtered as the estimator does it, is taken as the true one; the recorded force
and the fitted tensor make the true moment, ``M = r × F + Ω i``. Errors then act as in a simulated trial
(:mod:`uq.monte_carlo.gram_sums.error_maps`), and the estimator is applied again. An offset that is estimated or taken
from rest cancels in sums about the means or about the rest, so that the sums of runs of one mounting add up.

Of generalised least squares the weights are held fixed: with ``H = W Omega_R``, what is estimated along eliminated, the
tensor of disturbed signals is ``(Hᵀ Omega_R')⁻¹ Hᵀ (M' - r' × F')``. Where no residual is left, as here, its derivative
by the errors is that of the estimate. H takes the place of the undisturbed elements in the sums.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from identify.choices import OffsetChoice
from identify.least_squares.gram import Sums
from identify.least_squares.offsets import resting
from identify.least_squares.residual_spectrum import Lines
from identify.least_squares.run_lines import rows_of_lines, unbroken
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, Array, library_of
from identify.signals.differentiate import derivative
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import apply
from identify.signals.gravity_direction import upward_by_force
from identify.signals.resample import uniform_spline
from identify.signals.run import Rest, Run, RunError
from uq.monte_carlo.gram_sums.case_equations import feature_map
from uq.monte_carlo.gram_sums.error_maps import WrenchBasis, gyro_map, true_elements
from uq.monte_carlo.gram_sums.run_sums import FeatureSums, RunSums
from uq.sources.constant_errors import Errors

ELEMENTS = 18
"""Number of elements of the true motion: 1, omega, its products, t, t omega, t², alpha."""
FEATURES = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 15, 16, 17])
"""Indices of the thirteen features among the elements."""
FORCE, MOMENT, UP = (slice(ELEMENTS + k, ELEMENTS + k + 3) for k in (0, 3, 6))
"""Slices of force, moment and upward direction among a run's signals, the elements coming first."""
SIGNALS = UP.stop
BLOCK = 2**15
"""Samples of a block."""
SPLINE = 64
"""Samples at a block's end that the spline through it may be wrong in; it is wrong by 0.27 to this power."""


def run_sums(
    run: Run,
    estimator: EstimatorSpec,
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    basis: WrenchBasis,
    *,
    offsets: OffsetChoice,
    weight: float = 1.0,
    delays: Sequence[float] | np.ndarray = (0.0,),
    weighed: np.ndarray | None = None,
) -> RunSums:
    """Return a run's sums.

    Args:
        run: the run.
        estimator: its differentiator and filter.
        r_cg: centre of gravity from Q, in B [m].
        inertia: packed tensor about the centre of gravity [kg·m²].
        basis: functions of time that the measured wrench is made of.
        offsets: how constant offsets are removed.
        weight: of the run among others.
        delays: of the angular velocity, at which sums are taken [s], of
        :func:`uq.monte_carlo.gram_sums.run_sums.delay_nodes`.
        weighed: H on the first lines of the cosine transform, (k, 3, 6); None: ordinary least squares.

    Raises:
        RunError: the delays take more than half of the run.
    """
    taken = estimator.lost(run.rate)
    keep = rows_of_lines(run, len(run.t) - taken)
    lost = int(np.ceil(np.abs(delays).max() * run.rate))
    reached = (keep >= lost) & (keep < len(run.t) - taken - lost)
    if 2 * reached.sum() < len(keep):
        raise RunError(
            f"a delay of up to {np.abs(delays).max():.3g} s is declared, which takes more than half of {run.name}: "
            "record for longer, or declare what is known of the delay"
        )
    fixed = None if weighed is None else _in_time(weighed, Lines.of(unbroken(keep), run.rate))[:, reached]
    inside, up = keep[reached], upward_by_force(run, r_cg) if basis.motion else np.zeros_like(run.force)
    products, totals = (
        np.zeros((len(delays), ELEMENTS, ELEMENTS + SIGNALS)),
        np.zeros((len(delays), ELEMENTS + SIGNALS)),
    )
    for start in range(0, len(inside), BLOCK):
        rows = inside[start : start + BLOCK]
        first, last = max(rows[0] - SPLINE - lost, 0), rows[-1] + taken + SPLINE + lost + 1
        part = {name: getattr(run, name)[first:last] for name in ("t", "force", "moment", "omega")}
        block = replace(run, **part, missing=None)
        fixed_rows = None if fixed is None else fixed[:, start : start + len(rows)].astype(float)
        for k, (elements, signals) in enumerate(
            delayed_signals(block, up[first:last], rows - first, estimator, delays, begin=run.t[0])
        ):
            products[k] += (elements if fixed_rows is None else fixed_rows) @ signals.T
            totals[k] += signals.sum(axis=1)
    return sums_of_signals(
        weight * products, weight * totals, delays=np.asarray(delays), r_cg=r_cg, inertia=inertia, basis=basis,
        centred=offsets == "estimate", rest=resting(run) if offsets == "still" else None,
    )  # fmt: skip


def delayed_signals(
    run: Run,
    up: Float[np.ndarray, "n 3"],
    rows: Int[np.ndarray, " m"],
    estimator: EstimatorSpec,
    delays: Sequence[float] | np.ndarray,
    *,
    begin: float,
) -> Iterator[tuple[Float[np.ndarray, "18 m"], Float[np.ndarray, "45 m"]]]:
    """Yield for each delay the delayed elements of some rows, and these beside the signals without delay.

    Args:
        run: whose instants count.
        up: upward direction at them.
        rows: positions of the rows behind differentiator and filter.
        estimator: differentiator and filter.
        delays: of the angular velocity [s].
        begin: from when the elements' time counts [s].
    """
    half = len(estimator.taps(run.rate))
    wrench = smoothed(np.hstack([run.force, run.moment, up])[half : len(run.t) - half].T, run, estimator)
    plain = elements_of(run, run.omega, estimator, begin)[:, rows]
    signals = np.concatenate([plain, wrench[:, rows]])
    spline = uniform_spline(run.omega, 1 / run.rate) if np.any(delays) else None
    for delay in delays:
        elements = plain
        if spline is not None and delay != 0:
            shifted = spline(np.clip(run.t - delay, run.t[0], run.t[-1]) - run.t[0])
            elements = elements_of(run, shifted, estimator, begin)[:, rows]
        yield elements, np.concatenate([elements, signals])


def sums_of_signals(
    products: Float[np.ndarray, "delays 18 45"],
    totals: Float[np.ndarray, "delays 45"],
    *,
    delays: Float[np.ndarray, " delays"],
    r_cg: Float[np.ndarray, "3"],
    inertia: Float[np.ndarray, "6"],
    basis: WrenchBasis,
    centred: bool,
    rest: Rest | None = None,
) -> RunSums:
    """Return the sums of a fitted run from those of its signals.

    Args:
        products: of the delayed elements, or of H, with delayed elements and signals; see :func:`delayed_signals`.
        totals: sums of delayed elements and signals.
        delays: of the angular velocity, at which these are taken [s].
        r_cg: centre of gravity from Q, in B [m].
        inertia: packed tensor about the centre of gravity [kg·m²].
        basis: functions of time that the measured wrench is made of.
        centred: whether the signals' means are taken off.
        rest: readings of the load cell that are taken off; None: none.
    """
    signal = np.eye(SIGNALS)
    force, moment = signal[FORCE].copy(), np.zeros((3, SIGNALS))
    if rest is not None:
        force[:, 0] -= rest.force
    moment[:, FEATURES] = np.einsum("fai,i->af", OMEGA_R_OF_FEATURES, inertia)
    moment += np.cross(r_cg, force, axisb=0, axisc=0)
    parts = [force, moment, *([signal[10:11]] if basis.time else [])]
    if basis.motion:
        parts += [signal[4:10], signal[15:18], np.zeros((6, SIGNALS)), signal[UP]]
    if centred:
        products = products - products[:, :, :1] * (totals / totals[:, :1])[:, None]
    return RunSums.through(delays, products[:, :, :ELEMENTS], products[:, :, ELEMENTS:] @ np.concatenate(parts).T)


def _in_time(weighed: Float[np.ndarray, "k 3 6"], lines: Lines) -> Float[np.ndarray, "18 n"]:
    """Return rows on the first lines of the cosine transform at each instant, one after the other to bound memory."""
    columns = weighed.reshape(len(weighed), -1).T
    rows = np.empty((len(columns), len(lines.order)), np.float32)  # half the memory; sums round to 1e-9
    for row, column in zip(rows, columns, strict=True):
        row[:] = lines.samples(column)
    return rows


def measured(sums: RunSums, errors: Errors, wrench_map: Float[Array, "6 functions"]) -> Sums:
    """Return the sums of the signals of sensors with these errors.

    Args:
        sums: of the run.
        errors: constant errors.
        wrench_map: what they make of the wrench, :meth:`uq.monte_carlo.gram_sums.error_maps.WrenchBasis.map`.
    """
    gram, wrench = _delayed(sums, errors)
    elements = _features(errors)
    both = elements @ (wrench @ wrench_map.T) + (elements @ gram[:, 0])[:, None] * errors.cell_bias[None]
    return Sums(elements @ gram @ elements.T, both[:, :3], both[:, 3:])


def weighed_equations(
    sums: RunSums, errors: Errors, wrench_map: Float[Array, "6 functions"], r_cg: Float[Array, "3"]
) -> tuple[Float[Array, "6 6"], Float[Array, "6"]]:
    """Return ``Hᵀ Omega_R'`` and ``Hᵀ (M' - r' × F')`` of the signals of sensors with these errors.

    Args:
        sums: of the run, with H.
        errors: constant errors.
        wrench_map: what they make of the wrench.
        r_cg: believed centre of gravity, ``r'`` [m].
    """
    gram, wrench = _delayed(sums, errors)
    rows = (gram @ _features(errors).T).reshape(3, 6, -1)
    both = (wrench @ wrench_map.T + gram[:, :1] * errors.cell_bias[None]).reshape(3, 6, 6)
    xp = library_of(both, r_cg)
    about_cg = both[..., 3:] - xp.cross(r_cg, both[..., :3])
    return library_of(rows).einsum("apk,kaq->pq", rows, OMEGA_R_OF_FEATURES), xp.einsum("apa->p", about_cg)


def _delayed(sums: RunSums, errors: Errors) -> FeatureSums:
    return sums.at(sums.nearest(errors.gyro_delay))


def _features(errors: Errors) -> Float[Array, "13 18"]:
    """Return the matrix that gives the features of the measured angular velocity from the elements of the true one."""
    return feature_map(gyro_map(errors), errors.gyro_bias, errors.gyro_drift)


def elements_of(run: Run, omega: np.ndarray, estimator: EstimatorSpec, begin: float) -> Float[np.ndarray, "18 m"]:
    """Return the elements of an angular velocity at the run's instants, with the estimator's derivative, filtered.

    Args:
        run: whose instants count.
        omega: angular velocity at them [rad/s].
        estimator: its differentiator and filter.
        begin: from when the elements' time counts [s].
    """
    taps = estimator.taps(run.rate)
    inner = slice(len(taps), len(run.t) - len(taps))
    alpha = derivative(omega.T, taps)
    shared = true_elements(omega[inner].T, alpha, run.t[inner] - begin)
    return smoothed(np.concatenate([shared, alpha]), run, estimator)


def smoothed(signals: Float[np.ndarray, "k n"], run: Run, estimator: EstimatorSpec) -> Float[np.ndarray, "k m"]:
    """Return signals through an estimator's filter."""
    taps = estimator.filter_taps(run.rate)
    return signals if len(taps) == 1 else apply(signals, taps)
