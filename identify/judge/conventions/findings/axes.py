"""Two sensors have the same axes in another order.

## What it looks like

Gravity turns in the body as the gyro has it only if the accelerometer's x, y, z are other axes of the gyro. Or force
and moment fit the motion only if the load cell's x, y, z are other axes of the IMU.

## Why it matters

Each sensor may be right along its own axes. In one frame they contradict each other, and components of the tensor
change places and signs.

## How it is decided

All 24 orders of right-handed axes are tried on the sums of the run. Another one must explain it better than as
declared by a factor of exp(30) in likelihood. Which of two sensors is turned only the declared centre of gravity
tells: if it does not, the message has a line for each, with what it does to the tensor.

## What to do

Set `imu_rotation_to_body` or `wrench_rotation_to_body` as the message has it. Of the accelerometer against the gyro of
one IMU no key tells: correct the order of the channels where they are recorded.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.axis_hypotheses import Hypothesis
from identify.judge.conventions.convention_fit import ConventionSums, ImuSignal
from identify.judge.conventions.examined_run import ExaminedRun
from identify.judge.conventions.imu_conventions import accelerometer_axes
from identify.judge.cure import Cure, Entries, as_well, axes_text
from identify.judge.findings import Finding


class AccelerometerAxes(Finding):
    """An accelerometer whose axes are not the gyro's."""

    axes: Float[np.ndarray, "3 3"]
    """Rows of its axes along the gyro's."""
    cure = "swapped axes"

    @property
    def looks(self) -> str:
        axes = axes_text(self.axes)[1:-1]
        return f"gravity turns with the gyro only if the accelerometer's axes are the gyro's ({axes})"


class OtherAxes(Finding):
    """A load cell whose axes are not the IMU's."""

    axes: Float[np.ndarray, "3 3"]
    """Rows of its axes along the IMU's."""
    others: Sequence[Float[np.ndarray, "3 3"]] = ()
    """Axes that fit as well."""
    fits_as_well: Sequence[Entries | Cure] = ()
    """Settings that fit as well, of static poses."""
    turn: Cure
    """Rotation that turns one of the sensors back."""

    @property
    def looks(self) -> str:
        others = ", ".join(f"({axes_text(axes)[1:-1]})" for axes in self.others)
        doubt = f"; {others} fit as well" if others else as_well(self.fits_as_well)
        return (
            "load cell and IMU have different axes: they fit each other only if the load cell's x, y, z "
            f"are the IMU's ({axes_text(self.axes)[1:-1]}){doubt}"
        )

    @property
    def cure(self) -> Cure:
        return self.turn


EXAMPLES = (
    AccelerometerAxes(topic="/imu", axes=np.eye(3)[[1, 0, 2]]),
    OtherAxes(
        topic="/imu",
        axes=np.eye(3)[[1, 2, 0]],
        turn=Cure(choices=[Entries({"imu_rotation_to_body": np.eye(3)[[1, 2, 0]]})]),
    ),
)


def accelerometer_finding(imu: ImuSignal, topic: str) -> list[Finding]:
    """Return the finding on the accelerometer of an IMU, by its signals alone."""
    axes = accelerometer_axes(imu)
    return [] if axes is None else [AccelerometerAxes(topic=topic, axes=axes)]


def other_axes(run: ExaminedRun, before: ConventionSums, fits: Sequence[Hypothesis]) -> Finding:
    """Return the finding on axes of the load cell in another order than the IMU's.

    Args:
        run: under examination; afterwards its sums are those without the turn.
        before: sums of the run with the turn.
        fits: axes that fit, the best first.
    """
    matrix = fits[0].matrix
    topic, cure = run.turned_back(before, matrix)
    rivals = [fit for fit in fits[1:4] if fit.sensor == "wrench" and not np.allclose(abs(fit.matrix), abs(matrix))]
    others = [] if run.at_rest else [fit.matrix.T for fit in rivals]
    fits_as_well = run.rivals(fits[1:]) if run.at_rest else []
    return OtherAxes(topic=topic, axes=matrix.T, others=others, fits_as_well=fits_as_well, turn=cure)
