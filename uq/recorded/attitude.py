"""The attitude that a recording tells: by joints with a robot's description, by poses, or by an IMU's quaternion."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from jaxtyping import Float, Int

from rig.channels import ImuChannel, MotionChannel

UNIT = 1e-2
"""Departure of a quaternion's norm from 1 beyond which messages hold none."""
TURNS = 1e-6
"""Change of a quaternion's components below which messages hold a constant in its place."""


@dataclass(frozen=True, eq=False)
class RecordedAttitude:
    """Rotations from a sensor's frame to one at rest, at increasing instants."""

    instants: Int[np.ndarray, " n"]
    """Times of the rotations, on the clock of the run [ns]."""
    rotation: Float[np.ndarray, "n 3 3"]
    """Matrices from components along the sensor's axes to those along axes at rest."""

    @classmethod
    def of(cls, instants: np.ndarray, rotation: np.ndarray) -> "RecordedAttitude | None":
        """Return an attitude by samples, of which repeated instants count once; None: fewer than two."""
        times, first = np.unique(instants, return_index=True)
        return cls(times, rotation[first]) if len(times) > 1 else None

    def at(self, instants: np.ndarray) -> Float[np.ndarray, "m 3 3"]:
        """Return the attitude at other instants [ns], on the shortest way between samples; beyond the ends, theirs."""
        rotation = scipy.spatial.transform.Rotation.from_matrix(self.rotation)
        slerp = scipy.spatial.transform.Slerp((self.instants - self.instants[0]) * 1e-9, rotation)
        within = np.clip(instants, self.instants[0], self.instants[-1]) - self.instants[0]
        return np.asarray(slerp(within * 1e-9).as_matrix())

    def of_body(self, to_body: Float[np.ndarray, "3 3"]) -> "RecordedAttitude":
        """Return the attitude of the body, into whose axes a rotation turns the sensor's."""
        return replace(self, rotation=self.rotation @ to_body.T)


def recorded_attitude(source: ImuChannel | MotionChannel, instants: np.ndarray) -> RecordedAttitude | None:
    """Return the attitude that a channel's quaternions tell; None: it has none that turn.

    Args:
        source: channel of poses, odometry or an IMU, whose quaternions take components in the sensor's frame to those
            in a frame at rest (REP 103, REP 145).
        instants: of its messages [ns].
    """
    quaternion = source.orientation
    if quaternion is None or len(quaternion) < 2:
        return None
    norm = np.linalg.norm(np.clip(quaternion, -2, 2), axis=1)  # the square of 1e300 would be no number
    if not (np.abs(norm - 1) < UNIT).all() or float(np.ptp(quaternion, axis=0).max()) < TURNS:
        return None
    return RecordedAttitude.of(instants, scipy.spatial.transform.Rotation.from_quat(quaternion).as_matrix())
