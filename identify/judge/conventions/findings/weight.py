"""The body's weight, or a part of it, is not in the force.

## What it looks like

The mean force is far smaller than the weight; or it changes with the motion as that of a body whose weight is missing;
or its weight is that of another payload than its inertia. (A small error of the weight alone is a cause of this name,
with a size.)

## Why it matters

Mass and centre of gravity follow from the weight, and with wrong ones the tensor.

## How it is decided

The mean of the force is compared with the declared mass, or with the least mass that a body of such moments has; where
gravity turns all ways in the body, the changes of the force count. What is left of the force turns with gravity where
the load cell was zeroed with the body on it, and does not where the driver removed the weight. With an attitude one
fit `F = m f + Rᵀ p + F0` tells the weight that is missing. All of it is missing below three tenths of the declared
mass; a part or another payload is named from half of the weight without an attitude, with one from a tenth of the mass
and six standard deviations.

## What to do

Record without compensation, and zero the load cell without the body. Otherwise set what the message has: `zero`,
`compensated`, and of another payload its mass and centre of gravity as set in the driver.
"""

from collections.abc import Iterator

from identify.display.rounding import significant, with_uncertainty
from identify.judge.conventions.axis_hypotheses import Scales
from identify.judge.conventions.convention_fit import DeclaredRig
from identify.judge.conventions.examined_run import ExaminedRun
from identify.judge.conventions.free_rotation import COVERAGE
from identify.judge.conventions.removed_weight import (
    CERTAIN,
    PARTLY,
    ApparentMass,
    MissingWeight,
    mass_by_motion,
    missing_weight,
)
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding

LEAST_SHARE = 0.1
"""Part of the mass that the weight must lack or have too much to be named.

Choice: gain and mass together are better.
"""


class WeightMissing(Finding):
    """A force without the weight of the body."""

    mass: float
    """Mass whose weight the force is [kg]."""
    declared: float | None
    """Mass that is declared [kg]; None: there is none."""
    removal: MissingWeight
    """Ways in which the weight may have been removed."""

    @property
    def looks(self) -> str:
        declared = self.declared
        body = "a body with such moments" if declared is None else f"the declared {significant(declared)} kg"
        return f"the force is the weight of {significant(self.mass, 2)} kg, far less than that of {body}"

    @property
    def cure(self) -> Cure | str:
        return _restored(self.removal)


class WeightPartlyMissing(Finding):
    """A force that lacks a part of the weight throughout."""

    mass: float
    """Mass by the changes of the force [kg]."""
    share: float
    """Part of its weight that is missing."""
    removal: MissingWeight
    """Ways in which the weight may have been removed."""

    @property
    def looks(self) -> str:
        return (
            f"the force changes like that of about {significant(self.mass, 2)} kg, but {self.share:.0%} of its weight "
            "is missing throughout"
        )

    @property
    def cure(self) -> Cure | str:
        return _restored(self.removal)


class WeightOfAnotherPayload(Finding):
    """A force with the weight of another payload than its inertia."""

    weighs: float
    """Mass whose weight is in the force [kg]."""
    mass: float
    """Mass by the motion, or as declared [kg]."""
    removed: float
    """Mass whose weight the driver seems to have removed [kg]."""
    sigma: float
    """Standard uncertainty of their difference [kg]."""
    doubt: str = ""
    """Clause on what fits as well."""

    @property
    def looks(self) -> str:
        weighs, mass = self._kg(self.weighs), self._kg(self.mass)
        return f"the force has the weight of {weighs} kg, but the inertia of {mass} kg{self.doubt}"

    def _kg(self, mass: float) -> str:
        return with_uncertainty(mass, COVERAGE * self.sigma)

    @property
    def cure(self) -> Cure:
        as_set = ", and payload_mass and payload_r_cg_from_q as set in the driver,"
        compensated = Entries({"compensated": "gravity"}, remark=as_set)
        return Cure(question=f"weight of {self._kg(self.removed)} kg removed by the driver?", choices=[compensated])


EXAMPLES = (
    WeightMissing(topic="/wrench", mass=0.3, declared=19.7, removal=MissingWeight(True, None)),
    WeightPartlyMissing(topic="/wrench", mass=19.5, share=0.7, removal=MissingWeight(False, "undetermined")),
    WeightOfAnotherPayload(topic="/wrench", weighs=1.2, mass=3.4, removed=2.2, sigma=0.01),
)


def _restored(removal: MissingWeight) -> Cure | str:
    """Return how the weight was removed, as far as the run shows, and what restores it."""
    by_driver = None
    if removal.removed is not None:
        key = "gravity_from_force" if removal.removed == "force" else "gravity"
        doubt = ', or "gravity_from_force" if the moment still has it: this motion does not distinguish them'
        then = doubt * (removal.removed == "undetermined")
        by_driver = Cure(question="removed by the driver?", choices=[Entries({"compensated": key})], then=then)
    if not removal.zeroed:
        return by_driver or ""
    zeroed = Entries({"zero": "loaded"})
    return Cure(question="zeroed with the body on it?", choices=[zeroed], otherwise=by_driver)


def weight_missing(run: ExaminedRun, weight: ApparentMass, given: Scales) -> Finding:
    """Return the finding on a force that lacks the body's weight for certain.

    Args:
        run: under examination.
        weight: mass whose weight the force is.
        given: scales of the run.
    """
    removal = missing_weight(run.sums, given, run.declared)
    return WeightMissing(topic=run.wrench, mass=weight.mass, declared=run.declared.mass, removal=removal)


def weight_partly_missing(run: ExaminedRun, given: Scales) -> Iterator[Finding]:
    """Yield the finding on a weight that is partly missing, where the changes of the force determine the mass."""
    motion = mass_by_motion(run.sums)
    if motion is not None and motion.missing > PARTLY + 3 * motion.sigma / motion.mass:
        removal = missing_weight(run.sums, given, run.declared)
        yield WeightPartlyMissing(topic=run.wrench, mass=motion.mass, share=motion.missing, removal=removal)


def other_payload(
    declared: DeclaredRig, topic: str, *, mass: float, weighs: float, sigma: float, doubt: str
) -> list[Finding]:
    """Return the finding on a part of the weight, or all of it, that is missing in the force, or is too much.

    Args:
        declared: of body and rig.
        topic: what messages call the data.
        mass: by the motion, or as declared [kg].
        weighs: mass whose weight is in the force [kg].
        sigma: standard uncertainty of their difference [kg].
        doubt: clause on what explains the force as well.
    """
    missing = mass - weighs
    if abs(missing - (0.0 if declared.weighed else declared.removed)) < max(LEAST_SHARE * mass, CERTAIN * sigma):
        return []
    removed = missing + declared.removed * declared.weighed
    return [WeightOfAnotherPayload(topic=topic, weighs=weighs, mass=mass, removed=removed, sigma=sigma, doubt=doubt)]
