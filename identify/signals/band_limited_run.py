"""A run reduced to its motion's band: a few thousand instants that hold all that the samples say of it.

A motion of band B moves the wrench up to 2B (products of omega). Load cell and gyro pass through one flat low-pass and
are then decimated, the load cell to a few samples a period and the motion to many, so that a quintic spline between its
samples is exact to rounding. White noise stays white in the band: a decimated sample's is ``sigma / sqrt(factor)``.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from identify.signals.filters import apply, kaiser_low_pass
from identify.signals.resample import uniform_spline
from identify.signals.run import Run, RunError

ROWS_PER_PERIOD = 10.0
"""Samples of the load cell that are kept, a period of the motion's highest frequency."""
NODES_PER_PERIOD = 30.0
"""Nodes in a period of the motion's highest frequency, between which the motion is interpolated."""
PASSED = 2.5
"""Frequency up to which the low-pass is flat, in units of the motion's band."""
ATTENUATION = 140.0
"""Attenuation of the low-pass [dB]; in its pass band the gain is 1 within 1e-7."""
FEWEST_ROWS = 24
DEGREE = 5
"""Degree of the interpolating spline."""


@dataclass(frozen=True, eq=False)
class InBand:
    """Decimated signals of a run, component first."""

    t: Float[np.ndarray, " n"]
    """Instants of the load cell's rows from the first node on [s]."""
    force: Float[np.ndarray, "3 n"]
    """Force on the body at Q [N]."""
    moment: Float[np.ndarray, "3 n"]
    """Moment on the body about Q [N·m]."""
    used: Bool[np.ndarray, " n"]
    """Mask of the rows that count."""
    motion: Float[np.ndarray, "degree cells channels"]
    """Quintic spline of the angular velocity [rad/s] and, where there is one, the specific force [m/s²]."""
    step: float
    """Seconds from node to node."""
    stride: int
    """Nodes from row to row."""
    first: int
    """The node of the first row."""
    factor: int
    """Samples from row to row."""
    band: float
    """Highest frequency of the motion [Hz]."""
    zero_axes: Float[np.ndarray, "n 3 3"] | None = None
    """Rotations from B to the axes along which the load cell's zero is constant; None: B's."""

    @property
    def interval(self) -> float:
        """Seconds from row to row."""
        return self.step * self.stride

    @property
    def at_rows(self) -> slice:
        """The nodes of the rows."""
        return slice(self.first, self.first + (len(self.t) - 1) * self.stride + 1, self.stride)

    @property
    def duration(self) -> float:
        """Seconds from the first node to the last."""
        return self.step * self.motion.shape[1]

    @property
    def reach(self) -> float:
        """The largest delay that the ends of the run leave room for [s]."""
        return (self.first - 1) * self.step


def in_band(run: Run, band: float, *, reach: float, accelerometer: bool = False) -> InBand:
    """Reduce a run to its motion's band.

    Args:
        run: the run.
        band: highest frequency of the motion [Hz].
        reach: the largest delay of the motion against the load cell to allow for [s].
        accelerometer: whether the specific force is a part of the motion.

    Raises:
        RunError: the run is too short for that.
    """
    fine, stride = _factors(run.rate, band)
    taps = low_pass(run.rate, band, fine * stride)
    margin = int(np.ceil(reach * run.rate / fine)) + 1
    rows = ((len(run.t) - len(taps)) // fine - 2 * margin) // stride + 1
    if len(run.t) < len(taps) or rows < FEWEST_ROWS:
        raise RunError(
            f"{run.name} lasts {run.t[-1] - run.t[0]:.3g} s, too short for the joint estimate of a motion of "
            f"{band:.3g} Hz: record for longer, or use the method source"
        )
    first, step = margin * fine, fine / run.rate
    wrench = _decimated(np.hstack([run.force, run.moment])[first:], taps, fine * stride)[:rows]
    motion = np.hstack([run.omega, run.specific_force]) if accelerometer else run.omega  # type: ignore[list-item]
    axes = None
    if run.zero_at_rest and run.attitude is not None:
        axes = _decimated(run.attitude.reshape(-1, 9)[first:], taps, fine * stride)[:rows].reshape(-1, 3, 3)
    usable = _usable(run, len(taps))[first :: fine * stride][:rows]
    return InBand(
        t=step * np.arange(margin, margin + rows * stride, stride), force=wrench[:, :3].T, moment=wrench[:, 3:].T,
        used=usable, motion=uniform_spline(_decimated(motion, taps, fine), step, degree=DEGREE).pieces,
        step=float(step), stride=stride, first=margin, factor=fine * stride, band=float(band), zero_axes=axes,
    )  # fmt: skip


def _factors(rate: float, band: float) -> tuple[int, int]:
    """Samples from node to node, and nodes from row to row."""
    fine = max(int(rate / (NODES_PER_PERIOD * band)), 1)
    return fine, max(int(rate / fine / (ROWS_PER_PERIOD * band)), 1)


def low_pass(rate: float, band: float, factor: int) -> np.ndarray:
    """A Kaiser low-pass, flat over what is kept and closed where decimation would fold noise onto it."""
    if factor == 1:
        return np.ones(1)
    return kaiser_low_pass(rate, PASSED * band, rate / factor - PASSED * band, ATTENUATION)


def _decimated(samples: np.ndarray, taps: np.ndarray, factor: int) -> np.ndarray:
    """Filtered samples, every ``factor``-th, from the first on that has all its neighbours."""
    return np.ascontiguousarray(apply(samples.T, taps)[:, ::factor].T)


def _usable(run: Run, taps: int) -> np.ndarray:
    """Mask of the filtered samples that no sample reaches which must not be used."""
    if run.missing is None:
        return np.ones(len(run.t) - taps + 1, bool)
    return np.asarray(np.convolve(run.missing, np.ones(taps), "valid") < 0.5)
