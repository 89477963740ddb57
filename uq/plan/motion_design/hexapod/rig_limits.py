"""A rig's limits as figures, and how a trajectory stands to them over its whole run."""

from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from identify.motion.leg_limits import Effort, Limits, needs, peaks
from identify.motion.limit_peaks import Peak
from identify.motion.stewart_platform import lengths
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.mistakes import ExperimentError
from uq.plan.measurement.platform_run import effort_of, motion_at, peaks_at_home
from uq.plan.motion_design.search import bisected, in_pieces
from uq.progress_bar import Progress

HALVINGS = 11
"""Bisections of the interval in which the largest amplitude is sought."""
FROM_LIMIT = 1e-9
"""Relative distance from a limit that counts as met: the rounding of an integrated attitude."""
WEIGHT, LOOKS = 3.0, 8
"""Factor on a limit's excess by which a motion is reduced, since a leg's force, which includes the weight, shrinks
less; and the number of looks before it is given up."""
OfSize = Callable[[float], TrajectorySpec]

PIECE = 16_384
"""Instants that are looked at together: runs of all lengths are filled up to it, so that little is compiled."""


def resolved_limits(experiment: Experiment, per_period: int) -> Limits:
    """Return the rig's limits, the needs of a trajectory filled in where the legs' own are not declared.

    Args:
        experiment: with ``[platform.limits]``.
        per_period: instants, in a period of the bandwidth, at which that trajectory is looked at.

    Raises:
        ExperimentError: no limits, none on the legs' motion, or a body that they cannot carry at home.
    """
    if experiment.limits is None:
        raise ExperimentError("missing table [platform.limits]: state what the platform can do")
    limits = experiment.limits.figures
    if not np.isfinite(limits.bandwidth):
        raise ExperimentError("missing key platform.limits.bandwidth: state the command's highest frequency")
    if experiment.limits.trajectory is not None:
        _, spec = experiment.select(experiment.limits.trajectory)
        needed = needs(efforts(experiment, spec, per_period * limits.bandwidth))
        free = {"length": np.isinf(limits.length).any(axis=1)[:, None]}
        free |= {name: np.isinf(getattr(limits, name)) for name in ("speed", "acceleration", "force")}
        limits = limits._replace(
            **{name: np.where(at, getattr(needed, name), getattr(limits, name)) for name, at in free.items()}
        )
    if not (np.isfinite(limits.length).all() and np.isfinite(limits.speed).all()):
        raise ExperimentError("missing key platform.limits.length or speed: state both, or needs_of a trajectory")
    _carried_at_home(experiment, limits)
    return limits


def _carried_at_home(experiment: Experiment, limits: Limits) -> None:
    """Refuse limits that the weight alone exceeds, where every motion starts and ends."""
    worst = next(iter(peaks_at_home(experiment, limits)), None)
    if worst is None or worst.share <= 1:
        return
    if worst.quantity != "length":
        raise ExperimentError(f"platform.limits: {worst} at rest at home: raise the limit, or carry less")
    low, high = limits.length[worst.channel]
    length = lengths(experiment.platform, experiment.platform.home_pose)[worst.channel]
    raise ExperimentError(
        f"platform.limits.length is {low:g} to {high:g} m, but leg {worst.channel + 1} of platform.geometry is "
        f"{length:.3f} m long at home, where every motion starts and ends: give limits around it"
    )


def efforts(experiment: Experiment, spec: TrajectorySpec, rate: float) -> Effort:
    """Return what a trajectory asks for over its whole run, at instants of a rate [Hz], both ends included."""
    t = instants(spec, rate)
    filled = np.append(t, np.full(-len(t) % PIECE, t[-1]))  # so that the motion, too, is compiled once for many runs
    motion = motion_at(experiment, spec, filled)
    asked: Effort = in_pieces(partial(effort_of, experiment), motion, PIECE)
    return jax.tree.map(lambda x: x[: len(t)], asked)


def instants(spec: TrajectorySpec, rate: float) -> np.ndarray:
    """Return uniform instants [s] over a trajectory's whole run, both ends included."""
    return np.linspace(0.0, spec.duration, round(spec.duration * rate) + 1)


def uses(experiment: Experiment, spec: TrajectorySpec, limits: Limits, rate: float) -> list[Peak]:
    """Return each limit's largest use over a trajectory's whole run, at instants of a rate [Hz], largest first."""
    return peaks(efforts(experiment, spec, rate), limits, jnp.asarray(instants(spec, rate)))


def largest_size(experiment: Experiment, spec_at: OfSize, limits: Limits, rate: float) -> float:
    """Return the largest size, from 0 to 2, at which a trajectory meets the limits.

    Args:
        experiment: with platform and body.
        spec_at: the trajectory at a size.
        limits: to be met.
        rate: of the instants that are looked at [Hz].
    """

    def met(size: float) -> bool:
        return uses(experiment, spec_at(size), limits, rate)[0].share <= 1 + FROM_LIMIT

    low, high = (1.0, 1.2) if met(1.0) else (0.8, 1.0)
    if not met(low):
        low, high = 0.0, low
    elif met(high):
        low, high = high, 2.0
    return bisected(met, HALVINGS, low, high)


def reduced(
    experiment: Experiment,
    spec_at: OfSize,
    size: float,
    limits: Limits,
    rate: float,
    *,
    met: float = 1.0,
    tell: Progress = lambda *_: None,
) -> TrajectorySpec | None:
    """Return a trajectory at a size, made smaller until a finer look finds it within the limits; None: at no size.

    Args:
        experiment: with platform and body.
        spec_at: the trajectory at a size.
        size: to begin with.
        limits: to be met.
        rate: of the instants that are looked at [Hz].
        met: largest use of a limit that meets it.
        tell: called with the number of looks.
    """
    for number in range(LOOKS):
        tell("limits", number, LOOKS)
        spec = spec_at(size)
        use = uses(experiment, spec, limits, rate)[0].share
        if use <= met:
            tell("limits", LOOKS, LOOKS)
            return spec
        size = size / (1 + WEIGHT * (use - 1))
    return None
