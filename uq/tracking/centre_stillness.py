"""Stillness of the centre of gravity in a recorded run: its acceleration and displacement in the motion's band."""

from dataclasses import dataclass

import numpy as np
import scipy

from identify.rigid_body.dynamics import specific_force_at
from identify.signals.run import Run
from uq.campaign.trial_setup import true_motion
from uq.experiment.experiment import Experiment, TrajectorySpec

SLOWEST = 0.2
"""Frequency below which an acceleration gives no displacement [Hz]."""


@dataclass(frozen=True)
class Stillness:
    """Motion of the centre of gravity, root mean square over the run, all axes together."""

    acceleration: float
    """Measured acceleration of the centre of gravity, up to the motion's band [m/s²]."""
    planned: float
    """Planned acceleration of the centre of gravity [m/s²]."""
    apart: float
    """Acceleration of the measured less the planned motion [m/s²]."""
    displacement: float
    """Displacement of the centre of gravity in the measured motion, at frequencies of ``SLOWEST`` and above [m]."""
    by: str
    """Name of the sensor that shows it."""


def stillness_of(
    run: Run, experiment: Experiment, spec: TrajectorySpec, measured: TrajectorySpec, lag: float, band: float
) -> Stillness | None:
    """Return how the centre of gravity moved, by the accelerometer, or else by the load cell's force; None: unknown."""
    if experiment.r_cg_from_q is None or experiment.mass is None:
        return None
    motion, plan = true_motion(experiment, measured), true_motion(experiment, spec)
    upward = experiment.gravity * np.asarray(motion.rotation)[:, 2]
    planned = np.asarray(plan.specific_force_cg.T) - experiment.gravity * np.asarray(plan.rotation)[:, 2]
    at = np.asarray(motion.t)
    t = run.t - run.t[0] - lag
    if run.specific_force is not None:
        reading = scipy.interpolate.CubicSpline(t, run.specific_force)(np.clip(at, t[0], t[-1]))
        offset = np.asarray(experiment.r_cg_from_q) - (0.0 if run.imu_position is None else run.imu_position)
        turning = np.asarray(motion.omega.T), np.asarray(motion.alpha.T)
        force, by = specific_force_at(reading, *turning, offset), "accelerometer"
    else:
        reading = scipy.interpolate.CubicSpline(t, run.force)(np.clip(at, t[0], t[-1]))
        force, by = reading / experiment.mass, "load cell"
    inside = (at >= t[0]) & (at <= t[-1])
    in_a = np.einsum("nij,nj->ni", np.asarray(motion.rotation), np.asarray(force) - upward)
    plan_in_a = np.einsum("nij,nj->ni", np.asarray(plan.rotation), planned)
    signals = (in_a, plan_in_a, in_a - plan_in_a)
    (acceleration, displacement), (planned, _), (apart, _) = (_in_band(x[inside], spec.rate, band) for x in signals)
    return Stillness(
        acceleration=_rms(acceleration), planned=_rms(planned), apart=_rms(apart), displacement=_rms(displacement),
        by=by,
    )  # fmt: skip


def _in_band(acceleration: np.ndarray, rate: float, band: float) -> tuple[np.ndarray, np.ndarray]:
    """An acceleration from ``SLOWEST`` up to a band, and the displacement that it makes, (n, 3) each."""
    spectrum = np.fft.rfft(acceleration, axis=0)
    frequency = np.fft.rfftfreq(len(acceleration), 1 / rate)[:, None]
    inside = (frequency >= SLOWEST) & (frequency <= band)
    turn = (2 * np.pi * np.where(inside, frequency, 1.0)) ** 2
    both = (np.where(inside, spectrum, 0), np.where(inside, -spectrum / turn, 0))
    return tuple(np.fft.irfft(spectrum_of, len(acceleration), axis=0) for spectrum_of in both)  # type: ignore[return-value]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))
