"""Mass, centre of gravity and constant offsets of the load cell, from static poses.

At rest (4) leaves ``F = m f + F0`` and ``M = r × m f + M0``, where f is the specific force in the body frame (what a
perfect accelerometer reads, opposite to gravity): linear in ``(m, F0)`` and in ``(m r, M0)``.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from identify.display.rounding import fixed, significant, with_uncertainty
from identify.estimation.static_poses import pose_fit
from identify.estimation.static_poses.centre_result import Centre
from identify.estimation.static_poses.creep import Creep, creep
from identify.estimation.static_poses.gain_check import GainCheck, gain_check
from identify.estimation.static_poses.pose_fit import EXACT, LINEAR, Attitudes, PoseFit, PoseSignals, fit
from identify.estimation.static_poses.pose_outliers import Outlier, outliers
from identify.estimation.static_poses.zero_drift import ZeroDrift, misfit, zero_drift
from identify.exceptions import RunError
from identify.rigid_body.regressor import cross_matrices
from identify.signals.run import refuse_excess

DECISIVE = 12.0
"""Chi-square within which two explanations are not told apart: a likelihood of exp(6), one in 400."""
LEAST_TILT = 0.02
"""Spread of the poses' specific force in its second direction, as a part of gravity, below which they count as one."""
LARGE_RESIDUAL = 0.03
"""Residual force, as a part of the weight, that is worth a warning."""
UNEVEN = 5.0
"""Ratio of the centre of gravity's largest to its smallest uncertainty by direction, above which a warning is due."""
AXES = ("force x", "force y", "force z", "moment x", "moment y", "moment z")
SMALL = 1e-9
"""Uncertainty of a centre of gravity that no poses reach [m]."""
ORDER = (0, 4, 5, 6, 1, 2, 3, 7, 8, 9)
"""Indices of the ten parameters among the linear ones (m, F0, m r, M0)."""


def centre(
    force: ArrayLike,
    moment: ArrayLike,
    specific_force: ArrayLike,
    *,
    attitudes: Attitudes = EXACT,
    mass: tuple[float, float] | None = None,
    name: str = "the poses",
    used: Sequence[bool] | Bool[np.ndarray, " n"] | None = None,
    labels: Sequence[str] | None = None,
    progress: ArrayLike | None = None,
) -> Centre:
    """Estimate mass, centre of gravity and offsets from static poses by least squares.

    Ordinary least squares with the residuals' covariance across force and moment; ``r = (m r) / m``, and the covariance
    follows by the law of propagation (GUM 5.1.2; JCGM 102 6.2), with Welch and Satterthwaite's degrees of freedom.

    A mass from a scale is one more observation, unless the load cell's own contradicts it: then the mass is the
    scale's, and centre and offsets are those of the load cell alone, whose gain cancels in ``(m r) / m``.

    A pose that the others contradict is named and kept: its residual widens the intervals
    (:mod:`identify.estimation.static_poses.pose_outliers`). Readings that lag behind the load (creep, hysteresis) are
    corrected by a lag that is estimated along (:mod:`identify.estimation.static_poses.creep`).

    Args:
        force: mean force on the body, in B [N], shape (n, 3).
        moment: mean moment on the body about Q, in B [N·m], shape (n, 3).
        specific_force: opposite to gravity, in B [m/s²], shape (n, 3); its length is local gravity.
        attitudes: how far the direction of ``specific_force`` may be off.
        mass: from a scale, with its standard uncertainty [kg].
        name: what messages call the data.
        used: which poses count; None: all. The others are still what the load was before the next pose.
        labels: what messages call the poses; None: by their numbers, from 1.
        progress: when each pose was held, in any unit, shape (n,); None: one after another.

    Raises:
        RunError: wrong shapes, fewer than three poses, poses too similar, a mass that is not positive.
    """
    signals = PoseSignals(*(np.asarray(x, float) for x in (force, moment, specific_force)))
    _check_signals(signals, name)
    f = signals.specific_force
    counted = np.ones(len(f), bool) if used is None else np.asarray(used, bool)
    _check_poses(f[counted], name)
    gravity = float(np.linalg.norm(f, axis=1).mean())
    named = outliers(signals, attitudes, counted)
    inliers = counted & ~np.isin(np.arange(len(f)), [outlier.pose for outlier in named])
    order = np.arange(len(f), dtype=float) if progress is None else np.asarray(progress, float)
    drift, lag = _told_apart(signals, attitudes, inliers, order)
    further = [one.columns for one in (drift, lag) if one is not None]
    memory = np.concatenate(further, axis=2) if further else None
    if memory is not None:
        named = outliers(signals, attitudes, counted, memory)
    solution = fit(signals, attitudes, counted, memory=memory)
    if solution.values[0] <= 0:
        raise RunError(
            f"the force in {name} points along gravity (mass {solution.values[0]:.4g} kg): the wrench has the "
            "opposite sign or other axes, or the attitude is upside down: correct recording.wrench or the attitude"
        )
    check = None if mass is None else _checked(solution, mass)
    if check is not None and not check.contradicts:
        solution = fit(signals, attitudes, counted, mass=mass, memory=memory)
    values, jacobian = _parameters(solution.values)
    covariance, lasting = jacobian @ solution.covariance @ jacobian.T, jacobian @ solution.lasting
    by_wrench = np.zeros((LINEAR, *f.shape[:1], 6))
    by_wrench[:, counted] = np.einsum("pq,qnc->pnc", jacobian, solution.gain)
    degrees = solution.degrees_of_freedom[list(ORDER)]
    if mass is not None and check is not None and check.contradicts:
        values[0], degrees[0] = mass[0], np.inf
        covariance[0], covariance[:, 0] = 0.0, 0.0
        covariance[0, 0] = mass[1] ** 2
        lasting[0], by_wrench[0] = 0.0, 0.0
    result = Centre(
        mass=float(values[0]), r_cg=values[1:4], force_offset=values[4:7], moment_offset=values[7:],
        covariance=covariance, residuals=solution.residuals, degrees_of_freedom=degrees, gravity=gravity, gain=check,
        largest_tilt=_largest_tilt(f[counted]), lasting=lasting if lasting.size else None, by_wrench=by_wrench,
        further=None if memory is None else memory[counted],
    )  # fmt: skip
    labels = labels or [f"pose {number}" for number in range(1, len(f) + 1)]
    judged = [
        *map(_drifting, [] if drift is None else [drift]),
        *map(_lagging, [] if lag is None else [lag]),
        *(_off(outlier, labels) for outlier in named),
    ]
    return _warned(result, judged, f[counted])


def _told_apart(
    signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"], progress: np.ndarray
) -> tuple[ZeroDrift | None, Creep | None]:
    """The drift of the zero and the creep that the poses show, each beside the other; else what is likelier."""
    drift, lag = zero_drift(signals, attitudes, used, progress), creep(signals, attitudes, used)
    if drift is None or lag is None:
        return drift, lag
    further, late = (
        zero_drift(signals, attitudes, used, progress, lag.columns),
        creep(signals, attitudes, used, drift.columns),
    )
    if (further is None) != (late is None):
        return (drift, None) if late is None else (None, lag)
    if further is not None:
        return drift, late
    drifting, lagging = (fit(signals, attitudes, used, memory=one.columns) for one in (drift, lag))
    apart = misfit(lagging, signals, used) - misfit(drifting, signals, used)
    if abs(apart) > DECISIVE:
        return (drift, None) if apart > 0 else (None, lag)
    rival = f"; creep explains the poses as well, with a mass of {significant(lagging.values[0], 5)} kg"
    return drift._replace(rival=rival), None


def _drifting(drift: ZeroDrift) -> str:
    """The warning that the zero drifts."""
    return (
        f"the load cell's zero drifts, by {drift} from the first pose to the last{drift.rival}. It is estimated along, "
        "and the offsets are those midway; let the load cell warm up, or zero it between poses"
    )


def _lagging(lag: Creep) -> str:
    """The warning that readings lag behind the load."""
    force, moment = (
        with_uncertainty(100 * part, 100 * u) for part, u in zip(lag.part, lag.standard_uncertainty, strict=True)
    )
    return (
        f"the readings lag behind the load: {force} % of its change since the poses before is missing in the force, "
        f"{moment} % in the moment (creep or hysteresis). The result is corrected for it; hold each pose for longer "
        "before it counts"
    )


def _off(outlier: Outlier, labels: Sequence[str]) -> str:
    """The warning that the others contradict a pose."""
    unit = "N" if outlier.axis < 3 else "N·m"
    number = labels[outlier.pose].split()[1]
    return (
        f"{labels[outlier.pose]} contradicts the others: its {AXES[outlier.axis]} is off by "
        f"{significant(outlier.size, 2)} {unit}, {outlier.ratio:.0f} of their standard deviations. The intervals are "
        f"wider because of it; measure it again, or leave it out with --without {number}"
    )


def predicted_covariance(
    specific_force: ArrayLike, mass: float, r_cg: ArrayLike, scatter: ArrayLike, attitudes: Attitudes = EXACT
) -> np.ndarray:
    """Return the covariance of the ten parameters that is predicted for static poses before they are measured.

    Args:
        specific_force: of the poses, opposite to gravity, in B [m/s²], shape (n, 3), n at least 3.
        mass: expected [kg].
        r_cg: expected centre of gravity from Q, in B [m], shape (3,).
        scatter: covariance of each pose's mean force and moment [N², N²·m, N²·m²], shape (6, 6).
        attitudes: how far the direction of ``specific_force`` may be off.

    Returns:
        Covariance in the order of ``PARAMETERS``, shape (10, 10); meaningless where the poses do not
        determine the centre of gravity.
    """
    values = np.zeros(LINEAR)
    values[0], values[4:7] = mass, mass * np.asarray(r_cg, float)
    arrays = np.asarray(specific_force, float), np.asarray(scatter, float)
    _, jacobian = _parameters(values)
    return jacobian @ pose_fit.predicted_covariance(values, *arrays, attitudes) @ jacobian.T


def _checked(solution: PoseFit, mass: tuple[float, float]) -> GainCheck:
    factor = float(scipy.special.stdtrit(solution.degrees_of_freedom[0], 0.975))
    return gain_check(*mass, float(solution.values[0]), float(np.sqrt(solution.covariance[0, 0])), factor)


def _warned(result: Centre, judged: Sequence[str], f: np.ndarray) -> Centre:
    """The centre with its warnings, beside those of single poses."""
    warnings = [*judged]
    share = result.residual[0] / (result.mass * result.gravity)
    if share >= LARGE_RESIDUAL:
        warnings.append(
            f"the force's residuals are {significant(100 * share, 2)} % of the weight: "
            "check the rotations of load cell and attitude"
        )
    axes, along = result.directions
    ratio = along[2] / max(along[0], SMALL)
    if min(ratio, _unevenness(f)) > UNEVEN:
        worst = ", ".join(fixed(x, 2) for x in axes[2])
        warnings.append(
            f"the poses determine the centre of gravity {ratio:.1f} times worse along ({worst}), to "
            f"{significant(1e3 * along[2], 2)} mm, than across: tilt further, or about more axes"
        )
    if result.gain is not None and not result.gain.within:
        apart = "; the mass is the scale's, centre and offsets are the load cell's alone"
        warnings.append(f"{result.gain.verdict}{apart if result.gain.contradicts else ''}: check its calibration")
    return replace(result, warnings=tuple(warnings))


def _unevenness(f: Float[np.ndarray, "n 3"]) -> float:
    """Ratio of the centre of gravity's largest to its smallest uncertainty where all axes of the moment are alike."""
    levers = cross_matrices(f - f.mean(axis=0))
    information = np.linalg.eigvalsh(np.einsum("nij,nik->jk", levers, levers))
    return float(np.sqrt(information[2] / max(information[0], 1e-300)))


def _largest_tilt(f: np.ndarray) -> float:
    """The largest angle [rad] between a pose's specific force and their mean; half a turn where the mean vanishes."""
    up = f / np.linalg.norm(f, axis=1, keepdims=True)
    mean = up.mean(axis=0)
    length = np.linalg.norm(mean)
    return float(np.arccos(np.clip(up @ mean / length, -1, 1)).max()) if length > 1e-6 else float(np.pi)


def _check_signals(signals: PoseSignals, name: str) -> None:
    for what, values in zip(("force", "moment", "specific force"), signals, strict=True):
        if values.ndim != 2 or values.shape != (len(signals[0]), 3):
            shape = f"({len(signals[0])}, 3), three components per pose"
            raise RunError(f"{what} of {name} has shape {values.shape}: give {shape}")
        if not np.isfinite(values).all():
            bad = int(np.argmax(~np.isfinite(values).all(axis=1)))
            raise RunError(f"{what} of {name} is not finite at pose {bad + 1}: correct or remove it")
        refuse_excess(what, values, name)


def _check_poses(f: np.ndarray, name: str) -> None:
    if len(f) < 3:
        raise RunError(f"{len(f)} poses in {name}: give three or more, tilted about two axes")
    spread = np.linalg.svd(f - f.mean(axis=0), compute_uv=False) / (np.linalg.norm(f, axis=1).mean() * np.sqrt(len(f)))
    if spread[1] < LEAST_TILT:
        raise RunError(
            f"the poses of {name} are too much alike to separate the centre of gravity from the offsets (gravity "
            f"turns by {np.degrees(spread[1]):.2g}° in its second direction): tilt the body about two axes"
        )


def _parameters(linear: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The ten parameters, and their derivatives with respect to (m, F0, m r, M0)."""
    mass, r_cg = linear[0], linear[4:7] / linear[0]
    jacobian = np.eye(10)[list(ORDER)]
    jacobian[1:4] /= mass
    jacobian[1:4, 0] = -r_cg / mass
    values = np.concatenate([[mass], r_cg, linear[1:4], linear[7:]])
    return values, jacobian
