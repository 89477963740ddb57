"""Gravity is along other axes than declared, seen from the robot's or platform's base.

## What it looks like

The weight points away from where the declaration has it: the base hangs upside down, on a wall, or leans. Of static
poses the weight may point up.

## Why it matters

The specific force that joints or poses give, the mass and the centre of gravity follow from gravity in the base's
axes.

## How it is decided

By one fit `F = m f + Rᵀ p + F0` with the attitudes R, a free vector p along fixed axes and a zero F0 that may drift: p
is zero where gravity is as declared. Named from 3° and six standard deviations, where nothing else fits better. Of 320
clean runs of a simulated arm none is suspected.

## What to do

Set `urdf_gravity` as the message has it. Forces at rest do not tell gravity upside down from a reversed wrench or
force: the message has a line for each.
"""

import numpy as np

from identify.display.rounding import with_uncertainty
from identify.judge.conventions.convention_fit import Vector
from identify.judge.conventions.free_rotation import COVERAGE
from identify.judge.conventions.posed_force import GravityFit
from identify.judge.conventions.removed_weight import CERTAIN
from identify.judge.cure import Cure, Entries, Opposite
from identify.judge.findings import Finding

LEAST_ANGLE = np.radians(3.0)
"""Angle between the weight and the declared gravity from which another gravity is named.

Choice: a smaller lean is the estimate's own warning.
"""
AXIS = np.radians(0.3)
"""Angle within which, beside its uncertainty, gravity lies along an axis.

Choice: a plumb line is no better.
"""


class GravityElsewhere(Finding):
    """A weight that points away from the declared gravity."""

    angle: float
    """Angle between the two [rad]."""
    half_width: float
    """Half-width of the angle's interval of 95 % [rad]."""
    gravity: Vector
    """Gravity along the axes at rest that the weight shows [m/s²]."""
    doubt: str = ""
    """Clause on what fits as well."""

    @property
    def looks(self) -> str:
        angle = with_uncertainty(*np.degrees([self.angle, self.half_width]))
        return f"the weight points {angle} deg away from the declared gravity, seen from the axes at rest{self.doubt}"

    @property
    def cure(self) -> Cure:
        return Cure(question="base upside down, on a wall, or leaning?", choices=[gravity_entry(self.gravity)])


class PosesUpsideDown(Finding):
    """Static poses whose weight points up."""

    gravity: Vector
    """Gravity along the axes at rest, upside down [m/s²]."""

    @property
    def looks(self) -> str:
        return (
            "the weight of the poses points up: the wrench has the other sign, or the force alone, which mirrors the "
            "centre of gravity, or gravity is upside down; forces at rest do not tell"
        )

    @property
    def cure(self) -> Cure:
        wrench = Entries({"wrench": Opposite("on_sensor", "on_body")})
        return Cure(choices=[wrench, "the other sign in three rows of calibration", gravity_entry(self.gravity)])


EXAMPLES = (
    GravityElsewhere(topic="/wrench", angle=np.pi / 2, half_width=0.004, gravity=np.array([0.0, 9.81, 0.0])),
    PosesUpsideDown(topic="/wrench", gravity=np.array([0.0, 0.0, 9.81])),
)


def gravity_elsewhere(
    weight: Vector, gravity: Vector, sigma: float, *, topic: str, doubt: str
) -> GravityElsewhere | None:
    """Return the finding on a weight away from the declared gravity; None: it lies along it.

    Args:
        weight: upwards, along the axes at rest [N].
        gravity: as declared [m/s²].
        sigma: standard uncertainty of the weight across its direction [N].
        topic: what messages call the data.
        doubt: clause on what fits as well.
    """
    length, size = float(np.linalg.norm(weight)), float(np.linalg.norm(gravity))
    down, spread = gravity / size, sigma / max(length, 1e-12)
    angle = float(np.arctan2(np.linalg.norm(np.cross(weight, down)), -weight @ down))
    if not angle > max(LEAST_ANGLE, CERTAIN * spread):
        return None
    shown = along_axis(-weight / length, 3 * spread) * size
    return GravityElsewhere(topic=topic, angle=angle, half_width=COVERAGE * spread, gravity=shown, doubt=doubt)


def poses_upside_down(fit: GravityFit, gravity: Vector, topic: str) -> list[Finding]:
    """Return the finding on a weight as declared but for its sign, which acceleration alone tells from the wrench's.

    Args:
        fit: of the force at rest, gravity as declared.
        gravity: as declared [m/s²].
        topic: what messages call the data.
    """
    return [PosesUpsideDown(topic=topic, gravity=-gravity)] if fit.mass < -CERTAIN * fit.sigma_mass else []


def along_axis(down: Vector, spread: float) -> Vector:
    """The direction, or the axis that it lies along within its uncertainty."""
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(down)))
    axis[k] = np.sign(down[k])
    return axis if float(np.linalg.norm(np.cross(axis, down))) < np.sin(AXIS + spread) else down


def gravity_entry(gravity: Vector) -> Entries:
    """Return gravity along the axes at rest as an experiment file has it."""
    return Entries({"urdf_gravity": [f"{value:.3f} m/s^2" for value in np.round(gravity, 3) + 0.0]})
