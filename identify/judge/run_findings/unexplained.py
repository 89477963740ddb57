"""The residuals are larger than noise, and no cause that is looked for explains them.

## What it looks like

More remains of force or moment in the band of the motion than above it, where only noise is. Or the residuals follow
the motion as a known cause makes them, but the runs do not agree on its size, or no rig errs by as much.

## Why it matters

Something acts that the model lacks. It may shift the tensor by any amount: interval and covariance are widened by the
ratio to the noise, or by what the cause would shift.

## How it is decided

More than three times the noise remains in the band; or 1.5 times beside named causes that explain less than half of
the residuals, which then come second. A liquid that sloshes at 1.5 Hz, within the motion's band, looks like gains, air
and a cable. A cause is refused where the runs' values depart from a common one with a chance below 0.1 %, or where it
is larger than some 300 typical sizes.

## What to do

Look for a liquid, a loose part, a cable or anything that moves in the body. Record again, and if it stays, state the
wider interval.
"""

from identify.judge.findings import Finding, signed
from identify.results.declaration import ResidualCause

UNEXPLAINED = 3.0
"""Ratio of residuals in the motion's band to those above it from which an unnamed cause is reported.

Measured: at most 1.14 in 40 clean runs, above 3 with a body that sloshes (``tests.helpers.judge_margins``).
"""
IMITATED = 1.5
"""Ratio of residuals in the motion's band to those above it from which causes that explain less than ``EXPLAINS``
imitate one that is not looked for.

Measured: 2.0 to 2.1 in five runs with a liquid of 0.03 kg at 1.5 Hz; of clean ones no cause is named.
"""
EXPLAINS = 0.5
"""Part of the residuals that the named causes must explain to come before what none explains.

Choice: half; a body that sloshes at 1.5 Hz leaves more to all causes together.
"""


class InBandResidual(Finding):
    """Residuals in the band of the motion that no cause explains."""

    quantity: str
    axis: str
    ratio: float
    """Root mean square over that of the noise."""

    @classmethod
    def in_row(cls, run: str, ratio: float, row: int) -> ResidualCause:
        """Return it as an entry of a result; ``row``: of the wrench, counted from the last."""
        axis, quantity = f"b{row % 3 + 1}", "force" if row < -3 else "moment"
        return cls(topic=run, quantity=quantity, axis=axis, ratio=ratio).verdict(axis=axis, share=1 - ratio**-2)

    @property
    def looks(self) -> str:
        return (
            f"the residual {self.quantity} on {self.axis} is {self.ratio:.1f} times what noise explains in the band of "
            "the motion: no known cause fits"
        )

    cure = "look for a liquid, a loose part or a cable that moves; the interval is wider by as much"


class FollowsNoCause(Finding):
    """Residuals that follow the motion as no rig's error does."""

    most_like: str
    """Label of the cause that they are most like."""
    component: str
    shift: float
    """Shift of the component that the cause would make [g·m²]."""

    @property
    def looks(self) -> str:
        return (
            f"the residuals follow the motion, most like {self.most_like}, but the runs do not agree on its size, or "
            "no rig errs by as much: no known cause fits"
        )

    @property
    def cure(self) -> str:
        return f"the interval holds {self.component} {signed(self.shift)} g·m² off"


EXAMPLES = (
    InBandResidual(topic="run.mcap", quantity="moment", axis="b2", ratio=4.6),
    FollowsNoCause(topic="all 3 runs", most_like="gain", component="I11", shift=8.4),
)
