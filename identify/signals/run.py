"""A run: one uniformly sampled, aligned time series of wrench and motion, simulated or recorded."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from identify.exceptions import RunError
from identify.rigid_body.dynamics import specific_force_at
from identify.signals.power_spectrum import band_of, motion_spectrum, noise_level
from identify.signals.resample import (
    UNEQUAL,
    apart,
    below,
    beside,
    gaps,
    in_gap,
    interpolate,
    interval,
    is_uniform,
    jitter,
    refuse_jump,
)
from identify.signals.segments import runs_of_true
from identify.signals.shaped_noise import ShapedNoise

__all__ = ["Rest", "Run", "RunError"]


NOTHING = (np.array([]), np.array([]))
"""No bad instants of either sensor."""
SIGNALS = ("t", "force", "moment", "omega", "missing", "specific_force", "attitude")
"""Arrays of a run with an entry for each instant."""
LARGEST = 1e12
"""The most that a signal may be, in SI units: far beyond any sensor, and its fourth power still a number."""
SMALLEST = 1e-60
"""The least that the largest reading of a signal may be, unless it is 0: its fourth power is still a number."""


@dataclass(frozen=True)
class Rest:
    """Readings of a load cell while the body rests on it, over some segments."""

    force: Float[np.ndarray, "3"]
    """Mean force of the load cell at rest [N]."""
    moment: Float[np.ndarray, "3"]
    """Mean moment of the load cell about Q at rest [N·m]."""
    covariance: Float[np.ndarray, "6 6"]
    """Covariance of the mean force and moment, from their scatter."""
    seconds: float
    """Total time at rest [s]."""


@dataclass(frozen=True)
class Run:
    """Force, moment and angular velocity at common, uniform instants, samples first, all in the body frame B."""

    t: Float[np.ndarray, " n"]
    """Instants of the samples [s]."""
    force: Float[np.ndarray, "n 3"]
    """Force on the body at Q [N]."""
    moment: Float[np.ndarray, "n 3"]
    """Moment on the body about Q [N·m]."""
    omega: Float[np.ndarray, "n 3"]
    """Angular velocity of the body [rad/s]."""
    name: str = "run"
    """Name of the run in messages and results, such as a file name."""
    sha256: str | None = None
    """Hash of the file it was read from."""
    missing: Bool[np.ndarray, " n"] | None = None
    """Instants that must not be used: in a gap of a sensor, beside a bad sample, outside the segments; None: none."""
    warnings: tuple[str, ...] = field(default=())
    """Warnings about the data for the reader of the result."""
    left_out: Mapping[str, int] = field(default_factory=dict)
    """Number of samples that were left out, by reason."""
    segments: tuple[tuple[float, float], ...] = ()
    """Start and end of the segments to which the run was cut [s]; empty: it is whole."""
    detected: bool = False
    """Whether ``segments`` were detected by their motion rather than named."""
    overview: Float[np.ndarray, "m 2"] | None = None
    """Time and largest angular velocity of the whole run that the segments were cut from [s, rad/s], for a figure."""
    specific_force: Float[np.ndarray, "n 3"] | None = None
    """Specific force that the accelerometer measures, in B [m/s²]; None: there is no accelerometer."""
    imu_position: Float[np.ndarray, "3"] | None = None
    """Position of the accelerometer from Q, in B [m]; None: not known, taken as Q."""
    attitude: Float[np.ndarray, "n 3 3"] | None = None
    """Rotations from components in B to those along axes at rest; None: nothing tells them."""
    gravity: Float[np.ndarray, "3"] | None = None
    """Gravity along these axes, as declared [m/s²]; None: it is not."""
    zero_at_rest: bool = False
    """Whether the load cell's zero is constant along the axes at rest instead of along B's."""
    rest: Rest | None = None
    """Readings of the load cell while the body rests; None: not asked for."""
    noise: ShapedNoise | None = None
    """The angular velocity's noise, where it was differentiated; None: it is white."""
    mounting: str | None = None
    """Name of the mounting of the body that the run was made with; None: not declared."""
    about: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Particulars in the recording on its day and its instruments."""
    stamps_early: float = 0.0
    """Time by which the stamps of the motion are early against those of the wrench, by the log's times [s]."""
    sensor_rates: tuple[float, float] | None = None
    """Rates of wrench and angular velocity before they were brought together [Hz]; None: the run's own."""

    @property
    def rate(self) -> float:
        """Sample rate of the run [Hz]."""
        return (len(self.t) - 1) / float(self.t[-1] - self.t[0])

    @property
    def compact(self) -> "Run":
        """The run without the samples beyond it that its arrays are views of, in the same layout.

        So it is pickled: what is computed from it in another process has the same bits.
        """
        signals = {name: getattr(self, name) for name in SIGNALS if getattr(self, name) is not None}
        return replace(self, **{name: signal.copy(order="K") for name, signal in signals.items()})

    @property
    def usable(self) -> Bool[np.ndarray, " n"]:
        """Mask of the samples that are not ``missing``."""
        return np.ones(len(self.t), bool) if self.missing is None else ~self.missing

    @property
    def longest_segment(self) -> slice:
        """The longest segment in which every sample may be used; an empty one where none may."""
        return max(self.used(), key=lambda segment: segment.stop - segment.start, default=slice(0, 0))

    @cached_property
    def motion_spectrum(self) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m 3"]]:
        """Frequencies [Hz] and power density of the angular velocity in the longest segment."""
        return motion_spectrum(self.omega[self.longest_segment], self.rate)

    @cached_property
    def band(self) -> float:
        """Highest frequency at which the motion stands out from the gyro's noise, in the longest segment [Hz]."""
        return band_of(*self.motion_spectrum, self.rate)

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
            RunError: a wrong shape, fewer than two samples, a value that is not finite or beyond any sensor, time
                that does not increase.
            TypeError: a value is traced by JAX; :func:`identify.ordinary_least_squares` takes such.
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
        specific_force: ArrayLike | None = None,
        bad: tuple[np.ndarray, np.ndarray] = NOTHING,
    ) -> "Run":
        """Build a run from a load cell and an IMU that sample at their own instants of the same clock.

        Both are brought to uniform instants of the interval that they share, at the lower of the two rates, by cubic
        splines; where they share uniform instants already, samples are kept as they are. Where one rate is more than a
        fifth above the other, both pass through the same flat low-pass below half the lower rate first.

        Args:
            t_wrench: instants of the wrench [s], shape (n,).
            force: force on the body at Q, in B [N], shape (n, 3).
            moment: moment on the body about Q, in B [N·m], shape (n, 3).
            t_imu: instants of the angular velocity [s], shape (m,).
            omega: angular velocity in B [rad/s], shape (m, 3).
            name: what to call the run.
            sha256: hash of its file.
            specific_force: what the accelerometer reads, in B, at the instants of the angular velocity [m/s²].
            bad: instants of the wrench, and of the angular velocity, near which nothing must be used [s].

        Raises:
            RunError: as :meth:`from_arrays`, or the two share no interval.
        """
        at, wrench = _checked(name, "wrench", t_wrench, force=force, moment=moment)
        more = {} if specific_force is None else {"specific force": specific_force}
        at_imu, motion = _checked(name, "angular velocity", t_imu, omega=omega, **more)
        if np.array_equal(at, at_imu) and is_uniform(at) and not any(map(np.size, bad)):
            return cls(
                t=at, force=wrench[0], moment=wrench[1], omega=motion[0], name=name, sha256=sha256,
                specific_force=motion[1] if more else None,
            )  # fmt: skip
        start, stop = max(at[0], at_imu[0]), min(at[-1], at_imu[-1])
        if stop <= start:
            raise RunError(
                f"no overlap in {name}: wrench from {at[0]:.6g} to {at[-1]:.6g} s, angular velocity from "
                f"{at_imu[0]:.6g} to {at_imu[-1]:.6g} s; check the clocks"
            )
        intervals, warnings = [], list[str]()
        (at, *wrench), (at_imu, *motion), crowded = _apart((at, *wrench), (at_imu, *motion))
        for sensor, instants in (("wrench", at), ("angular velocity", at_imu)):
            refuse_jump(sensor, instants, name)
            intervals.append(interval(instants))
            warnings += [*gaps(sensor, instants), *jitter(sensor, instants)]
        step, reach = max(intervals), 0.0
        times, columns = [at, at_imu], [np.hstack(wrench), np.hstack(motion)]
        if step > UNEQUAL * min(intervals):
            times, columns, reach = below(0.5 / step, times, columns, intervals, name)
            start, stop = max(t[0] for t in times), min(t[-1] for t in times)
        t = start + step * np.arange(int((stop - start) / step * (1 + 1e-9)) + 1)
        if len(t) < 2:
            raise RunError(f"fewer than two samples in {name}: the sensors overlap for {stop - start:.3g} s only")
        gap = in_gap(at, t, reach) | in_gap(at_imu, t, reach)
        near_bad = beside(bad[0], t, intervals[0] + reach) | beside(bad[1], t, intervals[1] + reach)
        wrenches, motions = (interpolate(*samples, t) for samples in zip(times, columns, strict=True))
        missing = gap | near_bad
        return cls(
            t=t, force=wrenches[:, :3], moment=wrenches[:, 3:], omega=motions[:, :3], name=name, sha256=sha256,
            missing=missing if missing.any() else None, warnings=tuple(warnings),
            left_out=({"in a gap": int(gap.sum())} if gap.any() else {}) | crowded,
            specific_force=motions[:, 3:] if more else None, sensor_rates=(1 / intervals[0], 1 / intervals[1]),
        )  # fmt: skip

    def between(self, start: float, stop: float) -> "Run":
        """Return the part of the run from ``start`` to ``stop`` [s].

        Raises:
            RunError: fewer than two samples lie between.
        """
        keep = slice(*np.searchsorted(self.t, (start, np.nextafter(stop, np.inf))))  # of signals that are not copied
        if keep.stop - keep.start < 2:
            raise RunError(
                f"fewer than two samples in {self.name} between {start:g} and {stop:g} s: choose another part"
            )
        signals = {name: getattr(self, name)[keep] for name in SIGNALS if getattr(self, name) is not None}
        return replace(self, **signals, segments=((start, stop),))

    def within(self, segments: Iterable[tuple[float, float]]) -> "Run":
        """Return the run with all left out that lies outside the segments, each from one instant to another [s].

        Nothing is joined: differentiators and filters do not reach across what is left out.

        Raises:
            RunError: fewer than two samples lie within a segment.
        """
        segments = tuple(sorted((float(start), float(stop)) for start, stop in segments))
        for start, stop in segments:
            self.between(start, stop)
        cut = self.between(segments[0][0], segments[-1][1])
        inside = np.any([(cut.t >= start) & (cut.t <= stop) for start, stop in segments], axis=0)
        missing = ~(inside & cut.usable)
        outside = {"outside the part": len(self.t) - int(inside.sum())}
        left_out = {**self.left_out, **outside} if outside["outside the part"] else self.left_out
        return replace(cut, missing=missing if missing.any() else None, segments=segments, left_out=left_out)

    @property
    def accelerometer_position(self) -> Float[np.ndarray, "3"]:
        """Position of the accelerometer from Q, in B [m]: zero where it is not known."""
        return np.zeros(3) if self.imu_position is None else self.imu_position

    def specific_force_at(self, point: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 3"]:
        """Return the specific force at a point of the body from Q [m/s²], as the accelerometer shows it from its own.

        Args:
            point: in B [m].
        """
        assert self.specific_force is not None  # noqa: S101 - asked of runs with an accelerometer alone
        alpha = np.gradient(self.omega, self.t, axis=0)
        return specific_force_at(self.specific_force, self.omega, alpha, point - self.accelerometer_position)

    def white_noise(self, signal: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
        """Return the standard deviation of white noise on each axis of one of its signals, where it may be used."""
        return noise_level(*(signal[segment] for segment in self.used()))

    def used(self) -> list[slice]:
        """Return the segments of samples without one that must not be used."""
        return [slice(start, stop) for start, stop in runs_of_true(self.usable)]

    def cure(self, otherwise: str) -> str:
        """Return what a run that cannot be used needs: what was wrong with its samples, if anything was."""
        most = max(self.left_out.items(), key=lambda reason: reason[1], default=("", 0))
        if most[1] > len(self.t) / 2:
            return f"{most[1]} of its samples are left out ({most[0]})"
        return next((text.removeprefix(f"{self.name}: ") for text in self.warnings), otherwise)

    def __repr__(self) -> str:
        return f"Run({self.name!r}: {len(self.t):,} samples, {self.rate:.6g} Hz, {self.t[-1] - self.t[0]:.3f} s)"


def _apart(*sensors: tuple[np.ndarray, ...]) -> tuple[Any, ...]:
    """Instants and signals of each sensor without samples that come at nearly the instant of the one before.

    Last is their number, as a reason of what is left out.
    """
    kept = [apart(instants) for instants, *_ in sensors]
    count = sum(int((~keep).sum()) for keep in kept)
    parts = [tuple(part[keep] for part in sensor) for sensor, keep in zip(sensors, kept, strict=True)]
    return (*parts, {"beside another": count} if count else {})


def _checked(name: str, channel: str, t: ArrayLike, **signals: ArrayLike) -> tuple[np.ndarray, list[np.ndarray]]:
    t = numbers(f"time of the {channel} in {name}", t)
    if t.ndim != 1:
        raise RunError(f"times of the {channel} in {name} have shape {t.shape}: give one number per sample")
    if len(t) < 2:
        raise RunError(f"fewer than two samples of the {channel} in {name}: record for longer")
    arrays = []
    for signal, values in (("time", t), *signals.items()):
        values = numbers(f"{signal} in {name}", values)
        if signal != "time" and values.shape != (len(t), 3):
            raise RunError(
                f"{signal} in {name} has shape {values.shape}: give ({len(t)}, 3), three components per sample"
            )
        if not np.isfinite(values).all():
            bad = ~np.isfinite(values.reshape(len(t), -1)).all(axis=1)
            raise RunError(
                f"{signal} in {name} is not finite at sample {int(np.argmax(bad))} ({int(bad.sum())} such samples): "
                "remove them first"
            )
        refuse_excess(signal, values, name)
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


def numbers(what: str, value: Any) -> np.ndarray:
    """Return a value as an array of NumPy.

    Raises:
        TypeError: JAX traces it, or it is no array of numbers.
    """
    try:
        if np.issubdtype(getattr(value, "dtype", float), np.datetime64):
            raise TypeError(f"{what} is a date: give seconds, such as (t - t[0]) / np.timedelta64(1, 's')")
        return np.asarray(value, float)
    except ValueError:
        given = f", but is {value!r}" if isinstance(value, str) else ""
        raise TypeError(f"{what} must be an array of numbers in SI{given}") from None
    except TypeError as error:
        if not type(error).__module__.startswith("jax"):
            raise
    raise TypeError(f"{what} is traced by JAX, as jit, vmap and jacobian do: use identify.ordinary_least_squares")


def refuse_excess(signal: str, values: np.ndarray, name: str) -> None:
    """Refuse readings beyond any sensor, whose squares would be no numbers.

    Raises:
        RunError: a reading is larger than ``LARGEST``, or all are below ``SMALLEST``.
    """
    largest = max(values.max(), -values.min()) if values.size else 0.0
    if largest == 0 or SMALLEST <= largest <= LARGEST:
        return
    size = np.abs(values).reshape(len(values), -1).max(axis=1)
    size[~np.isfinite(size)] = 0  # another refusal's
    if len(size) and size.max() > LARGEST:
        at = f"{size.max():.1e} at sample {int(np.argmax(size))}"
        raise RunError(f"{signal} in {name} is {at}: no sensor reads so much; remove such samples first")
    if len(size) and 0 < size.max() < SMALLEST:
        raise RunError(f"{signal} in {name} is at most {size.max():.1e}: correct its unit or scale")
