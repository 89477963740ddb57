"""Deviation of a measured angular velocity from its plan: gain, lag and offset of each axis.

On each axis the plan is fitted, ``gain * plan(t - lag) + offset``: the lag is found by cross-correlation first and
then, with gain and offset, by least squares on the plan's own derivative, to a small part of a sample.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.motion.trajectory import Trajectory
from identify.rounding import significant
from identify.signals.run import Run, RunError
from uq.experiment.experiment import TrajectorySpec

ROUNDS = 6
"""Linear steps to lag, gain and offset."""
ALIKE = 0.5
"""Correlation with the plan below which a run does not count as a run of this plan."""


@dataclass(frozen=True)
class Followed:
    """Deviation of a measured signal from its plan, one figure an axis."""

    gain: Float[np.ndarray, "3"]
    """Amplitude over the planned one; not-a-number for an axis without a plan."""
    gain_standard_error: Float[np.ndarray, "3"]
    lag: Float[np.ndarray, "3"]
    """Delay behind the plan, counted from the run's first sample [s]."""
    lag_standard_error: Float[np.ndarray, "3"]
    offset: Float[np.ndarray, "3"]
    """Offset of the angular velocity from the plan [rad/s]."""
    residual: Float[np.ndarray, "3"]
    """Root mean square of what is left [rad/s]."""

    @property
    def common_lag(self) -> float:
        """The axes' lag, weighted by its standard errors [s]."""
        fitted = np.isfinite(self.lag)
        weight = 1 / np.maximum(self.lag_standard_error[fitted], 1e-12) ** 2
        return float((weight * self.lag[fitted]).sum() / weight.sum())


def follow(run: Run, spec: TrajectorySpec) -> Followed:
    """Return gain, lag and offset of a run's angular velocity against a trajectory's, on each axis.

    Raises:
        RunError: the run does not follow the trajectory.
    """
    t, measured = run.t - run.t[0], np.asarray(run.omega)
    usable = run.usable
    lag = np.full(3, _coarse_lag(run, spec))
    gain, offset = np.ones(3), np.zeros(3)
    scale = np.abs(plan_at(spec, t - lag[0])[0]).max()
    active = np.abs(plan_at(spec, t - lag[0])[0]).max(axis=0) > 1e-6 * scale
    error = np.full((3, 2), np.nan)
    residual = np.zeros(3)
    for _ in range(ROUNDS):
        for k in range(3):
            plan, slope = plan_at(spec, t - lag[k])
            inside = usable & (t >= lag[k]) & (t <= lag[k] + spec.duration)
            columns = np.stack([plan[:, k], -slope[:, k], np.ones(len(t))], axis=1)[inside]
            if not active[k]:
                offset[k], residual[k] = measured[inside, k].mean(), measured[inside, k].std()
                continue
            solution = np.linalg.lstsq(columns, measured[inside, k], rcond=None)[0]
            residuals = measured[inside, k] - columns @ solution
            gain[k], offset[k], residual[k] = solution[0], solution[2], np.sqrt(np.mean(residuals**2))
            if not gain[k] > 0:
                raise _unlike(run)
            spread = residual[k] * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
            error[k] = spread[0], spread[1] / gain[k]
            lag[k] += np.clip(solution[1] / gain[k], -0.05, 0.05)
    gain[~active], lag[~active] = np.nan, np.nan
    return Followed(
        gain=gain, gain_standard_error=error[:, 0], lag=lag, lag_standard_error=error[:, 1], offset=offset,
        residual=residual,
    )  # fmt: skip


def _coarse_lag(run: Run, spec: TrajectorySpec) -> float:
    """Lag by cross-correlation of all axes, with a parabola through its peak [s]."""
    measured = run.omega - run.omega.mean(axis=0)
    at = np.arange(int(np.ceil(spec.duration * run.rate))) / run.rate
    plan, _ = plan_at(spec, at)
    together = sum(scipy.signal.correlate(measured[:, k], plan[:, k], mode="full", method="fft") for k in range(3))
    k = int(np.argmax(together))
    likeness = together[k] / max(np.linalg.norm(measured) * np.linalg.norm(plan), 1e-300)
    if likeness < ALIKE:
        raise _unlike(run)
    shift = 0.0
    if 0 < k < len(together) - 1:
        before, here, after = together[k - 1 : k + 2]
        shift = 0.5 * (before - after) / min(before - 2 * here + after, -1e-300)
    return float((k + shift - (len(plan) - 1)) / run.rate)


def _unlike(run: Run) -> RunError:
    return RunError(
        f"the angular velocity of {run.name} is not like the plan's: name the trajectory that was run (--trajectory), "
        "or correct the sensor's axes in [recording]"
    )


def plan_at(spec: TrajectorySpec, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Planned angular velocity and acceleration at any instants, at rest outside the motion, (n, 3) each."""
    inside = (t > 0) & (t < spec.duration)
    omega, alpha = _sampled(spec.trajectory, jnp.asarray(np.clip(t, 0.0, spec.duration)))
    return np.where(inside[:, None], omega, 0.0), np.where(inside[:, None], alpha, 0.0)


@jax.jit
def _sampled(trajectory: Trajectory, t: Float[Array, " n"]) -> tuple[Array, Array]:
    return jax.vmap(trajectory.omega)(t), jax.vmap(trajectory.alpha)(t)


def verdicts(followed: Followed) -> list[str]:
    """Return warnings of a platform that did not follow."""
    off = np.abs(followed.gain - 1)
    worst = int(np.nanargmax(off))
    lines = []
    if off[worst] > 0.05:
        gain = significant(100 * followed.gain[worst])
        lines.append(f"the platform ran {gain} % of the planned amplitude about axis {worst + 1}")
    spread = np.nanmax(followed.lag) - np.nanmin(followed.lag)
    if spread > 5e-3:
        lines.append(f"the axes lag by unequal times, {significant(1e3 * spread)} ms apart")
    return lines
