"""The axes of two sensors are turned against each other by an angle that is no order of axes.

## What it looks like

Load cell and IMU fit each other only with a rotation between them, such as 30° about z. Or angular velocity and
attitude of one body are along axes that differ.

## Why it matters

A turn by θ mixes the components: a product of inertia takes up θ times the difference of two moments, 2 % of it at 1°.

## How it is decided

A grid of all rotations is tried on the sums of the run, Newton's method goes on from the best. A rotation must explain
the run better than as declared by a factor of exp(30) in likelihood; small ones are measured after all else, and named
from 0.5° and a chi-square of 40. Which of the two sensors is turned only the declared centre of gravity tells: if it
does not, the message has a line for each, with what it does to the tensor.

## What to do

Set `imu_rotation_to_body` or `wrench_rotation_to_body`, of the sensor that is mounted otherwise, as the message has
it. A small turn may be stamps that are late, where their lag is too uncertain to be named: correct the clock, or
declare the delay. Of two sensors with axes of their own use one.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identify.display.rounding import fixed
from identify.judge.conventions.axis_hypotheses import Scales, misalignment
from identify.judge.conventions.convention_fit import Matrix, Vector
from identify.judge.conventions.examined_run import ON_SENSOR, ExaminedRun
from identify.judge.conventions.findings.mirror import ImuMirroredAndTurned
from identify.judge.conventions.free_rotation import (
    CERTAIN_SHIFT,
    LEAST_TURN,
    FreeRotation,
    small_turn_text,
    turn_text,
)
from identify.judge.cure import Cure, Entries, as_well
from identify.judge.findings import Finding
from identify.rigid_body.rotation import exponential


class Turned(Finding):
    """A rotation between load cell and IMU."""

    vector: Vector
    """Rotation vector of the IMU's axes into the load cell's [rad]."""
    u: float
    """Standard uncertainty of the angle [rad]."""
    reversed: bool = False
    """Whether force and moment have the reversed sign, too."""
    turn: Cure
    """Rotation that turns one of the sensors back."""
    fits_as_well: Sequence[Entries | Cure] = ()
    """Settings that fit as well."""

    @property
    def looks(self) -> str:
        turn = turn_text(self.vector, self.u)
        sign = ", and force and moment have the reversed sign" * self.reversed
        doubt = as_well(self.fits_as_well)
        return f"only a rotation of the IMU's axes into the load cell's by {turn} fits both{sign}{doubt}"

    @property
    def cure(self) -> Cure:
        return replace(self.turn, with_it=[ON_SENSOR]) if self.reversed else self.turn


class TurnedALittle(Finding):
    """A small rotation between load cell and IMU."""

    vector: Vector
    """Rotation vector of the IMU's axes into the load cell's [rad]."""
    covariance: Matrix
    """Covariance matrix of ``vector`` [rad²]."""
    turn: Cure
    """Rotation that turns one of the sensors back."""

    @property
    def looks(self) -> str:
        turn = small_turn_text(self.vector, self.covariance)
        return f"only a rotation of the IMU's axes into the load cell's by {turn} fits both, or its stamps are late"

    @property
    def cure(self) -> Cure:
        return replace(self.turn, then=", or correct the clock")


class RateAxes(Finding):
    """An angular velocity along other axes than the attitude's."""

    vector: Vector
    """Rotation vector from the axes of the angular velocity to those of the attitude [rad]."""

    @property
    def looks(self) -> str:
        angle = float(np.linalg.norm(self.vector))
        about = ", ".join(fixed(part, 2) for part in self.vector / angle)
        degrees = fixed(np.degrees(angle), 1)
        return f"the axes of angular velocity and attitude differ by a rotation of {degrees} deg about ({about})"

    cure = "two sensors? use one of them: import without the columns of the other, or record the attitude as poses"


def _cure(vector: np.ndarray) -> Cure:
    return Cure(choices=[Entries({"imu_rotation_to_body": np.asarray(exponential(vector).T)})])


_TURNED, _A_LITTLE = np.array([0.0, 0.0, 0.52]), np.array([0.0, 0.021, 0.0])
EXAMPLES = (
    Turned(topic="/imu", vector=_TURNED, u=0.0004, turn=_cure(_TURNED)),
    TurnedALittle(topic="/imu", vector=_A_LITTLE, covariance=1e-6 * np.eye(3), turn=_cure(_A_LITTLE)),
    RateAxes(topic="/imu", vector=np.array([0.0, 0.0, 1.57])),
)


def rotation_finding(run: ExaminedRun, rotation: FreeRotation, fits_as_well: Sequence[Entries | Cure] = ()) -> Finding:
    """Return the finding on any rotation, and on what is reversed besides.

    Args:
        run: under examination; afterwards its sums are those without the rotation.
        rotation: of the IMU's axes into the load cell's.
        fits_as_well: settings that fit as well.
    """
    topic, turn = run.turned_back(rotation.reversed.applied(run.sums), rotation.matrix.T)
    vector, u = rotation.vector, rotation.standard_uncertainty
    is_reversed = not np.array_equal(rotation.reversed.matrix, np.eye(3))
    if is_reversed and rotation.reversed.sensor == "imu":
        return ImuMirroredAndTurned(topic=topic, vector=vector, u=u)
    return Turned(topic=topic, vector=vector, u=u, reversed=is_reversed, turn=turn, fits_as_well=fits_as_well)


def small_turn_findings(run: ExaminedRun, given: Scales) -> Iterator[Finding]:
    """Yield the finding on a small rotation that no declared misalignment lets expect."""
    turn, certainty, covariance = misalignment(run.sums, given)
    if certainty > CERTAIN_SHIFT and float(np.linalg.norm(turn)) > LEAST_TURN:
        topic, cure = run.turned_back(run.sums, exponential(turn).T)
        both = covariance + np.diag(run.declared.turn**2)
        if turn @ np.linalg.solve(both, turn) > CERTAIN_SHIFT:
            yield TurnedALittle(topic=topic, vector=turn, covariance=covariance, turn=cure)
