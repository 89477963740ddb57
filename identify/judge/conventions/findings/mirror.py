"""The axes of a sensor are left-handed.

## What it looks like

Force and moment fit the motion only if one axis of a sensor is reversed, which no rotation does.

## Why it matters

A driver that swaps two channels or reverses one makes a mirrored world: products of inertia and the centre of gravity
have wrong signs.

## How it is decided

All 48 signed orders of the axes are tried on the sums of the run, then any rotation of a mirrored IMU. Another one
must explain the run better than as declared by a factor of exp(30) in likelihood. A left-handed load cell is one whose
sign is reversed and whose axes are turned: the two are the same.

## What to do

Correct order and signs of the channels of an IMU where they are recorded. Of a load cell set the lines that the
message has.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.axis_hypotheses import Hypothesis
from identify.judge.conventions.convention_fit import Vector
from identify.judge.conventions.examined_run import ON_SENSOR, ExaminedRun
from identify.judge.conventions.free_rotation import turn_text
from identify.judge.cure import Cure, Entries, as_well, axes_text
from identify.judge.findings import Finding

CHANNELS = "correct order and signs of its channels where they are recorded; no rotation in [recording] can"


class ImuMirrored(Finding):
    """An IMU with left-handed axes."""

    axes: Float[np.ndarray, "3 3"]
    """Rows of the axes that fit the wrench, along those recorded."""

    @property
    def looks(self) -> str:
        return f"the IMU's axes are left-handed: only ({axes_text(self.axes)[1:-1]}) of them fit the wrench"

    cure = CHANNELS


class ImuMirroredAndTurned(Finding):
    """An IMU with left-handed axes that are turned besides."""

    vector: Vector
    """Rotation vector of its axes into the load cell's [rad]."""
    u: float
    """Standard uncertainty of the angle [rad]."""

    @property
    def looks(self) -> str:
        turn = turn_text(self.vector, self.u)
        return (
            f"the IMU's axes are left-handed, and only a rotation of its axes into the load cell's by {turn} fits both"
        )

    cure = CHANNELS


class WrenchMirrored(Finding):
    """A load cell with left-handed axes, or reversed and turned."""

    turn: Cure
    """Rotation that turns the reversed axes back."""
    fits_as_well: Sequence[Entries | Cure] = ()
    """Settings that fit as well."""
    imu_instead: str = ""
    """Centre of gravity if it is an accelerometer that is left-handed; empty: it is none."""

    @property
    def looks(self) -> str:
        imu = "; or the accelerometer's axes are left-handed, or its sign is reversed and its axes turned"
        doubt = as_well(self.fits_as_well) + f"{imu} ({self.imu_instead}): {CHANNELS}" * bool(self.imu_instead)
        return f"the load cell's axes are left-handed, or its sign is reversed and its axes turned{doubt}"

    @property
    def cure(self) -> Cure:
        return Cure(choices=self.turn.choices, with_it=[ON_SENSOR], verb="both are undone by")


EXAMPLES = (
    ImuMirrored(topic="/imu", axes=np.eye(3)[[1, 0, 2]]),
    ImuMirroredAndTurned(topic="/imu", vector=np.array([0.2, 0.0, 0.1]), u=0.002),
    WrenchMirrored(
        topic="/wrench", turn=Cure(choices=[Entries({"wrench_rotation_to_body": np.diag([-1.0, -1.0, 1.0])})])
    ),
)


def mirrored_wrench(run: ExaminedRun, fits: Sequence[Hypothesis]) -> Finding:
    """Return the finding on axes of the wrench that are left-handed, or turned and reversed.

    Args:
        run: under examination.
        fits: axes and signs that fit, the best first, whose matrix is improper.
    """
    turn = -fits[0].matrix
    # a left-handed cell is one reversed and turned by half a turn; any other turn may be the IMU's
    cell = Cure(choices=[Entries({"wrench_rotation_to_body": turn @ run.declared.wrench_rotation})])
    cure = cell if np.allclose(turn, turn.T) else run.rotation_cure(run.recorded, turn)
    imu_instead = run.place(mirrored=False) if run.at_rest and run.declared.measured else ""
    return WrenchMirrored(topic=run.wrench, turn=cure, fits_as_well=run.rivals(fits[1:]), imu_instead=imu_instead)
