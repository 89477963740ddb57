"""The recorded attitude is read otherwise than it was written.

## What it looks like

The forces fit the attitudes only with a quaternion's fields in another order, Euler angles of another convention, or
the attitude taken the other way, from level axes to the sensor's. Or the angular velocity fits the attitude only so.

## Why it matters

Weight, and of poses and joints the motion, follow from the attitude. Read wrongly, it turns gravity the wrong way.

## How it is decided

By one fit `F = m f + Rᵀ p + F0` with the attitudes R, a free vector p along fixed axes and a zero F0 that may drift,
for each reading. Another reading must explain the forces far better. Or by the angular velocity against the turns of
the attitude over 0.1 s: another order must raise their correlation by 0.1. What fits as well is named beside it.

## What to do

Set `takes`, `quaternion` or `euler_convention` as the message has it. What the driver's manual states of the fields'
order decides where several fit.
"""

from collections.abc import Sequence

from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding


class AttitudeReadOtherwise(Finding):
    """Attitudes that the forces fit only if they are read in another way."""

    how: str
    """The way, in words."""
    doubt: str
    """Clause on ways that fit as well."""
    settings: Sequence[Entries]
    """Keys that declare this reading."""

    @property
    def looks(self) -> str:
        return f"the forces fit the attitudes only {self.how}{self.doubt}"

    @property
    def cure(self) -> Cure:
        *others, last = self.settings
        return Cure(choices=[last], with_it=others)


class QuaternionFields(Finding):
    """A quaternion whose fields the angular velocity fits only in another order."""

    order: str
    settings: Entries
    """Key that declares the order."""

    @property
    def looks(self) -> str:
        return f"the angular velocity fits the attitude only with the quaternion's fields read as ({self.order})"

    @property
    def cure(self) -> Cure:
        return Cure(choices=[self.settings])


EXAMPLES = (
    AttitudeReadOtherwise(
        topic="poses.csv",
        how="taken the other way",
        doubt="",
        settings=[Entries({"takes": "level_to_sensor"}, table="poses")],
    ),
    QuaternionFields(topic="/imu", order="w, x, y, z", settings=Entries({"quaternion": "w, x, y, z"})),
)
