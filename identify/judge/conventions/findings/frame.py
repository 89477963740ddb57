"""Force and moment, or the load cell's zero, are along other axes than declared: those at rest, or those that turn.

## What it looks like

Many robots give the wrench along the axes of the base. Then the weight stays in one direction while the sensor turns.
The zero of such a wrench may be constant along either axes.

## Why it matters

Every moment is then along wrong axes as soon as the body turns. No rotation that is constant corrects it.

## How it is decided

By one fit `F = m f + Rᵀ p + F0` with the attitudes R, a free vector p along fixed axes and a zero F0 that may drift;
the same with the force turned to the axes of the other kind. The best must explain the force far better than as
declared. Without a recorded attitude that of gyro and accelerometer counts. Of 320 clean runs of a simulated arm none
is suspected.

## What to do

Set `wrench_frame` as the message has it. `"base"` needs an attitude in the recording: joints, poses or a quaternion.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.display.rounding import fixed
from identify.judge.conventions.convention_fit import Matrix
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding
from identify.rigid_body.rotation import exponential

LEAST_YAW = np.radians(3.0)
"""Turn about the vertical from which the axes of the wrench are not those of the attitude.

Choice: bases are set up to a degree or two.
"""


class WrenchAtRest(Finding):
    """A wrench along axes at rest that is declared along those of the sensor."""

    doubt: str = ""
    """Clause on what fits as well."""
    attitude_recorded: bool
    """Whether the recording has the attitude that turns the wrench back."""
    yaw: float = 0.0
    """Turn about the vertical from the attitude's axes at rest to those of the wrench [rad]."""
    rotation: Matrix
    """Rotation from the load cell's axes to the body's, as declared."""

    @property
    def looks(self) -> str:
        return (
            "force and moment are along axes at rest: they fit weight and motion only if the attitude turns them into "
            f"the body's axes{self.doubt}"
        )

    @property
    def cure(self) -> Cure | str:
        settings: dict[str, object] = {"wrench_frame": "base"}
        if not self.attitude_recorded:
            line = Entries(settings).line
            return (
                f"record joint states, poses or a quaternion, which turn it back with {line} in [recording], or the "
                "wrench in the sensor's frame"
            )
        if abs(self.yaw) > LEAST_YAW:
            turn = exponential(np.array([0.0, 0.0, _near_right_angle(self.yaw)]))
            settings["wrench_rotation_to_body"] = np.round(turn @ self.rotation, 9)
        return Cure(choices=[Entries(settings)])


def _near_right_angle(yaw: float) -> float:
    right = np.pi / 2 * round(yaw / (np.pi / 2))
    return float(right if abs(yaw - right) < LEAST_YAW else yaw)


class WrenchTurns(Finding):
    """A wrench along the axes of the sensor that is declared along those at rest."""

    doubt: str = ""
    """Clause on what fits as well."""

    @property
    def looks(self) -> str:
        return f"force and moment are along axes that turn with the body, not along those at rest{self.doubt}"

    cure = Cure(choices=[Entries({"wrench_frame": "sensor"})])


class ZeroAtRest(Finding):
    """A zero of the force that is constant along axes at rest."""

    zero: Sequence[float] | Float[np.ndarray, "3"]
    """Zero along these axes [N]."""

    @property
    def looks(self) -> str:
        zero = ", ".join(fixed(value, 1) for value in self.zero)
        return f"the zero of the force, about ({zero}) N, is constant along the axes at rest, not along the sensor's"

    cure = Cure(choices=[Entries({"zero_frame": "base"})])


EXAMPLES = (
    WrenchAtRest(topic="/wrench", attitude_recorded=True, yaw=np.pi / 2, rotation=np.eye(3)),
    WrenchTurns(topic="/wrench"),
    ZeroAtRest(topic="/wrench", zero=[3.1, -0.4, 7.9]),
)
