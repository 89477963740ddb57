"""The joint model: the unknowns of a run, and what is taken as known.

Rows are (4) and (5) at the load cell's instants, with the motion of the IMU taken ``delay`` later and turned into the
load cell's frame. The specific force f at the centre of gravity comes from one of three:

- ``still``: the centre of gravity is at rest, f is opposite to gravity, whose direction follows from the gyro;
- ``accelerometer``: f is what the accelerometer reads, carried to the centre of gravity;
- ``none``: f is not measured; (5) alone counts, with the measured force in it.

Beside the body and the alignment there are the sensors' constant errors. All are zero unless a prior leaves them free.
In NumPy: a compiled model would be compiled anew for every length of run, which takes longer than the estimate.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.errors.registry import ERRORS
from identify.motion.attitude import GAUSS
from identify.signals.band_limited_run import InBand
from identify.signals.resample import UniformSpline

SpecificForce = Literal["still", "accelerometer", "none"]
"""Source of the specific force at the centre of gravity."""
WANDER = 3
"""Terms of the slow wander of the attitude that the gyro's white noise causes."""
SIZES = {
    "inertia": 6, "mass": 1, "r_cg": 3, "force_offset": 3, "moment_offset": 3, "gyro_bias": 3, "tilt": 2, "delay": 1,
    "rotation": 3, "accelerometer_bias": 3, "force_drift": 3, "moment_drift": 3, "wander": 3 * WANDER,
    "cg_from_still": 3, "gravity": 1, "gyro_scale": 3, "gyro_drift": 3, "cell_matrix": 36,
}  # fmt: skip
"""The unknowns in their order, and how many numbers each is. SI units:

- ``inertia``: packed tensor about the centre of gravity, in B [kg·m²]; ``mass`` [kg]; ``r_cg``: centre of gravity from
  Q, in B [m];
- ``force_offset`` [N], ``moment_offset`` [N·m]: constants that the load cell adds to the force and to the moment about
  Q; ``force_drift``, ``moment_drift``: their changes from the run's start to its end;
- ``gyro_bias`` [rad/s]: constant that the gyro adds, in its own axes; ``gyro_drift`` [rad/s²]: its slope, counted from
  the run's middle; ``wander`` [rad/s^0.5]: amplitudes of its slow noise, three axes of each term, in the unit of its
  white noise's density; ``gyro_scale``: relative error of its scale factor on each axis;
- ``tilt`` [rad]: rotation of the vertical at the first node, about two axes at right angles to it;
- ``delay`` [s] of the IMU: time from the measurement of a sample to its stamp; ``rotation`` [rad]: rotation vector of
  the rotation from the IMU's axes to B;
- ``accelerometer_bias`` [m/s²]: constant that the accelerometer adds, in its own axes;
- ``cg_from_still`` [m]: the centre of gravity from the point that is at rest, in B, where it is declared still;
- ``gravity`` [m/s²]: local gravity less what is stated;
- ``cell_matrix``: ``D`` row by row, the load cell reading ``(1 + D)`` times the wrench (force, moment): scale factors,
  cross-talk and a small misalignment [1, N per N·m, N·m per N].
"""
BY_ACT = {error.name: error for error in ERRORS.values() if error.unknowns == (error.name,) and not error.by_hand}
"""Further errors that are unknowns: to first order, since their derivatives are from their act."""
SIZES |= {name: error.count for name, error in BY_ACT.items()}
_ENDS = np.cumsum(list(SIZES.values()))
SLICES = {name: slice(int(end) - size, int(end)) for (name, size), end in zip(SIZES.items(), _ENDS, strict=True)}
"""Slice of each unknown in the vector of all unknowns."""
COUNT = int(_ENDS[-1])
TEN = ("mass", "r_cg", "inertia")
"""The ten parameters of the body, in their order."""
LEFT_OUT = 0.001
"""Largest share of a run's rows that is left out for speed."""


@dataclass(frozen=True, eq=False)
class Model:
    """A run's rows and what is needed to predict them."""

    rows: InBand
    up: Float[np.ndarray, "3"]
    """Direction opposite to gravity at the first node, in the IMU's axes, about which ``tilt`` is."""
    gravity: float
    """Local gravity that is stated [m/s²]."""
    imu_position: Float[np.ndarray, "3"]
    """The accelerometer, from Q, in B [m]."""
    specific_force: SpecificForce
    used: Bool[np.ndarray, " rows"]
    """Mask of the rows that count."""

    @cached_property
    def spline(self) -> UniformSpline:
        """Angular velocity [rad/s] and, where there is one, specific force [m/s²] in the IMU's axes, by time."""
        return UniformSpline(self.rows.motion, self.rows.step)

    @cached_property
    def between_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """The IMU's signals at the two Gauss points between each node and the next, by which the attitude turns."""
        nodes = self.rows.step * np.arange(self.rows.motion.shape[1])
        first, second = (self.spline(nodes + (0.5 + sign * GAUSS) * self.rows.step) for sign in (-1, 1))
        return first, second

    @cached_property
    def at_nodes(self) -> Float[np.ndarray, "nodes channels"]:
        """The IMU's signals at the nodes."""
        return self.spline(self.rows.step * np.arange(self.rows.motion.shape[1] + 1))

    def late(self, delay: float) -> tuple[np.ndarray, ...]:
        """Return the IMU's signals at the rows that count, ``delay`` [s] later, and their first two derivatives.

        Those of the last delay are kept: most searches have one throughout.
        """
        if delay not in self._late:
            self._late.clear()
            t = self.rows.t[self.used] + delay
            self._late[delay] = tuple(self.spline(t, order) for order in range(3))
        return self._late[delay]

    @cached_property
    def _late(self) -> dict[float, tuple[np.ndarray, ...]]:
        return {}

    def with_fast_transform(self) -> "Model":
        """Return the model with a few less of many rows, for a three times faster transform."""
        count = int(self.used.sum())
        fast = int(scipy.fft.prev_fast_len(count)) if count else 0
        if count - fast > LEFT_OUT * count:
            return self
        return replace(self, used=self.used & (np.cumsum(self.used) <= fast))


def unknowns(theta: Float[np.ndarray, " count"]) -> Mapping[str, np.ndarray]:
    """Return the unknowns of a flat vector, by name."""
    return {name: theta[where] for name, where in SLICES.items()}
