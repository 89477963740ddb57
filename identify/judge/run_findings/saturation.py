"""A sensor's range ends within the motion: samples stay at an extreme value.

## What it looks like

Many samples of a channel have the largest or the smallest value of the run.

## Why it matters

Beyond its range a sensor tells nothing. Samples that read too little make the tensor wrong, by an amount that
residuals hardly show.

## How it is decided

Ten samples or more at one extreme, and three times as many as at the value next to it: noise of a fine resolution
brings one there, a coarse resolution fewer than to its neighbour. Five or more in a row are left out before, so they
are not a finding: the result counts them as left out.

## What to do

Move less, or take a sensor of a larger range.
"""

import numpy as np
from jaxtyping import Float

from identify.display.rounding import significant
from identify.display.text_tables import counted
from identify.judge.findings import Finding
from identify.results.declaration import ResidualCause
from identify.signals.run import Run

FLAT = 10
"""Samples of one extreme value from which a sensor's range has ended.

Choice: noise of a fine resolution has one. Of a coarse one, see ``OVER_NEXT``.
"""
OVER_NEXT = 3
"""Samples of the extreme value over those of the value next to it from which a sensor's range has ended.

Choice: a coarse resolution gives the extreme value fewer samples than its neighbour.
"""
ONE_VALUE = 1e-6
"""Part of a signal's range within which samples are of one value.

Numerical: stamps rounded to nanoseconds make a spline to uniform instants move samples of 1 kHz by less.
"""
QUANTITIES = {"force": "force", "moment": "moment", "omega": "angular velocity"}


class ClippedChannel(Finding):
    """A channel whose samples stay at one extreme value."""

    quantity: str
    axis: str
    value: float
    """Extreme value, in SI."""
    count: int
    """Samples that stay there."""

    @property
    def looks(self) -> str:
        where = f"the {self.quantity} on {self.axis} stays at {significant(self.value, 4)}"
        return f"{where} in {counted(self.count, 'sample')}: the sensor's range ends there"

    cure = "move less"


EXAMPLES = (ClippedChannel(topic="run.mcap", quantity="angular velocity", axis="b3", value=4.363, count=182),)


def saturated(run: Run) -> list[ResidualCause]:
    """Return a finding for each end of each channel at which samples stay that are not left out."""
    return [
        ClippedChannel(topic=run.name, quantity=name, axis=f"b{axis}", value=end, count=count).verdict(
            axis=f"b{axis}", share=count / len(values)
        )
        for quantity, name in QUANTITIES.items()
        for axis, signal in enumerate(getattr(run, quantity).T, 1)
        for values in [signal if run.missing is None else signal[run.usable]]
        for end in (values.min(), values.max())
        if (count := _at_end(values, end))
    ]


def _at_end(values: Float[np.ndarray, " n"], end: float) -> int:
    """Count of samples that stay at an extreme value; 0: no more than noise or a coarse resolution brings there."""
    width = ONE_VALUE * max(end - values.min(), values.max() - end)
    if np.count_nonzero((values >= end - width) & (values <= end + width)) < FLAT:  # as mostly
        return 0
    away = np.abs(values - end)
    count, beyond = int(np.count_nonzero(away <= width)), away[away > width]
    if count < FLAT or not len(beyond) or np.ptp(beyond) <= width:  # a signal of two values is no clipped one
        return 0
    return count if count > OVER_NEXT * np.count_nonzero(beyond <= beyond.min() + width) else 0
