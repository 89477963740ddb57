"""A run: one uniformly sampled, aligned time series of wrench and motion, simulated or recorded."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from identify.shaped_noise import ShapedNoise

JITTER_TOLERANCE = 1e-3
"""Departure from uniform sampling, as a part of the sample interval, below which samples are taken as they are."""
JITTER_WARNING = 0.05
"""Standard deviation of the intervals, as a part of their mean, that is worth a warning."""
GAP = 5.0
"""Sample intervals without a sample that count as a gap."""


class RunError(ValueError):
    """A run that cannot be used, in one line: what, where, what to do."""


@dataclass(frozen=True)
class Run:
    """Force, moment and angular velocity at common, uniform instants, samples first, all in the body frame B."""

    t: Float[np.ndarray, " n"]
    """Instants [s]."""
    force: Float[np.ndarray, "n 3"]
    """Force on the body at Q [N]."""
    moment: Float[np.ndarray, "n 3"]
    """Moment on the body about Q [N·m]."""
    omega: Float[np.ndarray, "n 3"]
    """Angular velocity [rad/s]."""
    name: str = "run"
    """What messages and results call it: a file name, if it has one."""
    sha256: str | None = None
    """Hash of the file it was read from."""
    missing: Bool[np.ndarray, " n"] | None = None
    """Instants inside a gap of a sensor, where values are interpolated and must not be used; None: no gap."""
    warnings: tuple[str, ...] = field(default=())
    """What a reader of the result should know of the data."""
    noise: ShapedNoise | None = None
    """The angular velocity's noise, where it was differentiated; None: it is white."""
    notes: tuple[str, ...] = ()
    """What was assumed to read it."""

    @property
    def rate(self) -> float:
        """Sample rate [Hz]."""
        return (len(self.t) - 1) / float(self.t[-1] - self.t[0])

    @classmethod
    def from_arrays(
        cls, t: ArrayLike, force: ArrayLike, moment: ArrayLike, omega: ArrayLike, *, name: str = "run"
    ) -> "Run":
        """Build a run from samples at common instants.

        Args:
            t: instants [s], increasing, shape (n,). Resampled when they are not uniform.
            force: force on the body at Q, in B [N], shape (n, 3).
            moment: moment on the body about Q, in B [N·m], shape (n, 3).
            omega: angular velocity in B [rad/s], shape (n, 3).
            name: what to call the run.

        Raises:
            RunError: a wrong shape, fewer than two samples, a value that is not finite, time that does not increase.
        """
        return cls.from_channels(t, force, moment, t, omega, name=name)

    @classmethod
    def from_channels(
        cls,
        t_wrench: ArrayLike,
        force: ArrayLike,
        moment: ArrayLike,
        t_imu: ArrayLike,
        omega: ArrayLike,
        *,
        name: str = "run",
        sha256: str | None = None,
    ) -> "Run":
        """Build a run from a load cell and an IMU that sample at their own instants of the same clock.

        Both are brought to uniform instants of the interval that they share, at the lower of the two rates, by cubic
        splines; where they share uniform instants already, samples are kept as they are.

        Args:
            t_wrench: instants of the wrench [s], shape (n,).
            force: force on the body at Q, in B [N], shape (n, 3).
            moment: moment on the body about Q, in B [N·m], shape (n, 3).
            t_imu: instants of the angular velocity [s], shape (m,).
            omega: angular velocity in B [rad/s], shape (m, 3).
            name: what to call the run.
            sha256: hash of its file.

        Raises:
            RunError: as :meth:`from_arrays`, or the two share no interval.
        """
        at, (of_force, of_moment) = _checked(name, "wrench", t_wrench, force=force, moment=moment)
        at_imu, (of_omega,) = _checked(name, "angular velocity", t_imu, omega=omega)
        if np.array_equal(at, at_imu) and _is_uniform(at):
            return cls(at, of_force, of_moment, of_omega, name, sha256)
        start, stop = max(at[0], at_imu[0]), min(at[-1], at_imu[-1])
        if stop <= start:
            raise RunError(
                f"no overlap in {name}: wrench from {at[0]:.6g} to {at[-1]:.6g} s, angular velocity from "
                f"{at_imu[0]:.6g} to {at_imu[-1]:.6g} s; check the clocks"
            )
        interval = max(_interval(t) for t in (at, at_imu))
        t = start + interval * np.arange(int((stop - start) / interval * (1 + 1e-9)) + 1)
        if len(t) < 2:
            raise RunError(f"fewer than two samples in {name}: the sensors overlap for {stop - start:.3g} s only")
        sensors = {"wrench": at, "angular velocity": at_imu}
        warnings = [
            text for sensor, times in sensors.items() for text in (*_gaps(sensor, times), *_jitter(sensor, times))
        ]
        missing = _in_gap(at, t) | _in_gap(at_imu, t)
        wrench = _interpolate(at, np.hstack([of_force, of_moment]), t)
        return cls(
            t,
            wrench[:, :3],
            wrench[:, 3:],
            _interpolate(at_imu, of_omega, t),
            name,
            sha256,
            missing if missing.any() else None,
            tuple(warnings),
        )

    def between(self, start: float, stop: float) -> "Run":
        """Return the part of the run from ``start`` to ``stop`` [s].

        Raises:
            RunError: fewer than two samples lie between.
        """
        keep = (self.t >= start) & (self.t <= stop)
        if keep.sum() < 2:
            raise RunError(
                f"fewer than two samples in {self.name} between {start:g} and {stop:g} s: choose another part"
            )
        missing = None if self.missing is None else self.missing[keep]
        signals = {name: getattr(self, name)[keep] for name in ("t", "force", "moment", "omega")}
        return replace(self, **signals, missing=missing)

    def __repr__(self) -> str:
        return f"Run({self.name!r}: {len(self.t):,} samples, {self.rate:.6g} Hz, {self.t[-1] - self.t[0]:.3f} s)"


def _checked(name: str, channel: str, t: ArrayLike, **signals: ArrayLike) -> tuple[np.ndarray, list[np.ndarray]]:
    t = np.asarray(t, float)
    if t.ndim != 1:
        raise RunError(f"times of the {channel} in {name} have shape {t.shape}: give one number a sample")
    if len(t) < 2:
        raise RunError(f"fewer than two samples of the {channel} in {name}: record for longer")
    arrays = []
    for signal, values in (("time", t), *signals.items()):
        values = np.asarray(values, float)
        if signal != "time" and values.shape != (len(t), 3):
            raise RunError(
                f"{signal} in {name} has shape {values.shape}: give ({len(t)}, 3), three components a sample"
            )
        bad = ~np.isfinite(values.reshape(len(t), -1)).all(axis=1)
        if bad.any():
            raise RunError(
                f"{signal} in {name} is not finite at sample {int(np.argmax(bad))} ({int(bad.sum())} such samples): "
                "remove them first"
            )
        arrays.append(values)
    steps = np.diff(t)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0))
        how = "runs backwards" if steps[k] < 0 else "stands still"
        raise RunError(
            f"time of the {channel} in {name} {how} at sample {k + 1} ({t[k]:.9g} s, then {t[k + 1]:.9g} s): "
            "use the other clock or repair the recording"
        )
    return t, arrays[1:]


def _is_uniform(t: np.ndarray) -> bool:
    step = (t[-1] - t[0]) / (len(t) - 1)
    return bool(np.max(np.abs(t - t[0] - step * np.arange(len(t)))) < JITTER_TOLERANCE * step)


def _interval(t: np.ndarray) -> float:
    """The mean interval between samples, gaps left out [s]."""
    steps = np.diff(t)
    return float(steps[steps <= GAP * np.median(steps)].mean())


def _in_gap(t: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Which instants ``at`` lie inside a gap between the samples ``t``."""
    steps = np.diff(t)
    after = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(steps) - 1)
    return steps[after] > GAP * np.median(steps)


def _jitter(channel: str, t: np.ndarray) -> tuple[str, ...]:
    steps = np.diff(t)
    steps = steps[steps <= GAP * np.median(steps)]
    spread, mean = float(steps.std()), float(steps.mean())
    if spread < JITTER_WARNING * mean:
        return ()
    return (f"the stamps of the {channel} jitter by {1e3 * spread:.3g} ms at an interval of {1e3 * mean:.3g} ms",)


def _gaps(channel: str, t: np.ndarray) -> tuple[str, ...]:
    steps = np.diff(t)
    wide = steps > GAP * np.median(steps)
    if not wide.any():
        return ()
    return (
        f"{int(wide.sum())} gaps in the {channel}, the longest {steps.max():.3g} s at {t[np.argmax(steps)]:.6g} s, "
        "left out",
    )


def _interpolate(t: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    return make_interp_spline(t, values, k=min(3, len(t) - 1))(at)
