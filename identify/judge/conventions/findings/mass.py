"""The force is the weight of another mass than declared, or the mass changes during the run.

## What it looks like

The force at rest is the weight of a mass that is more than 15 % from the declared one, and no other unit explains it.
Or the force is that of one mass up to an instant, and that of another afterwards. (Smaller errors of the mass are a
cause of this name, with a size.)

## Why it matters

The moment about Q holds m r × (a - g). With a wrong mass the tensor about the centre of gravity takes up the
difference, m d² for a lever d.

## How it is decided

The mass is that by which the force follows the specific force, or its mean over gravity, with what zero and noise
leave open. A run cannot tell a wrong mass from gains that force and moment share, a part beside the body such as an
adapter, or, about a point at rest, gravity of another place and the lift of the air: the message states the cure of
each.

## What to do

Weigh the body. Then correct `body.mass`, the unit of the force or the calibration, or state what else the load cell
carries. Of a body that was grasped or released, identify only the part of the run that the message names.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from identify.display.rounding import fixed, significant
from identify.judge.conventions.posed_force import PosedForce
from identify.judge.findings import Finding

MASS_TOLERANCE = 0.15
"""Departure of the force at rest from the declared weight that is no finding.

Choice: an error of gain or zero is smaller. In 40 clean runs at most 0.04 (``tests.helpers.judge_margins``).
"""
HANDLING = 0.5
"""Time about the change of a mass that is left to the gripper [s].

Choice: grippers close in less.
"""


class WeightOfAnotherMass(Finding):
    """A force that is the weight of another mass than declared."""

    weighs: float
    """Mass whose weight the force is [kg]."""
    declared: float
    """Mass that is declared [kg]."""

    @property
    def looks(self) -> str:
        return (
            f"the force is the weight of {significant(self.weighs)} kg, the declared mass is "
            f"{significant(self.declared)} kg"
        )

    cure = (
        "correct body.mass, force_unit or the load cell's calibration; or state what else the load cell carries in "
        "[fixture] and in body.mass; or the driver removed another payload's weight: state payload_mass and "
        "payload_r_cg_from_q"
    )


class ChangedMass(Finding):
    """A body that is grasped or put down during the run."""

    time: float
    """Instant of the change [s]."""
    before: float
    """Mass before the change [kg]."""
    after: float
    """Mass after the change [kg]."""

    @property
    def looks(self) -> str:
        before, after = fixed(self.before, 2), fixed(self.after, 2)
        until = fixed(self.time, 1)
        return f"the force is that of {before} kg up to {until} s of the run, and that of {after} kg afterwards"

    @property
    def cure(self) -> str:
        grasped = self.after > self.before
        option = f"--from {self.time + HANDLING:.1f}" if grasped else f"--to {self.time - HANDLING:.1f}"
        return f"body grasped or released during the run? identify the run with {option}"


EXAMPLES = (
    WeightOfAnotherMass(topic="/wrench", weighs=24.1, declared=19.7),
    ChangedMass(topic="/wrench", time=12.3, before=0.42, after=2.61),
)


def mass_finding(mass: float, uncertainty: float, declared: float | None, topic: str) -> Iterator[Finding]:
    """Yield the finding on a declared mass that no unit explains.

    Args:
        mass: whose weight the force is [kg].
        uncertainty: expanded uncertainty of it [kg].
        declared: the declared mass [kg]; None: there is none.
        topic: what messages call the data.
    """
    if declared is not None and abs(mass - declared) > MASS_TOLERANCE * declared + uncertainty:
        yield WeightOfAnotherMass(topic=topic, weighs=mass, declared=declared)


def changed_mass(posed: PosedForce, time: Float[np.ndarray, " n"], topic: str) -> list[Finding]:
    """Return the finding on a body grasped or put down midway, where that explains what no single body does.

    Args:
        posed: force of the run.
        time: its instants [s].
        topic: what messages call the data.
    """
    step = posed.mass_step()
    if not posed.explained(step):
        return []
    at = float(posed.motion.smooth(time[:, None])[step.sample, 0])
    return [ChangedMass(topic=topic, time=at, before=step.before, after=step.after)]
