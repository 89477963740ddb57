"""The resolution of a sensor is coarse: a channel has few different values over the whole run.

## What it looks like

The samples of a channel lie on a few steps.

## Why it matters

Rounding to steps that the motion hardly crosses is no white noise: it follows the motion, and so may shift the tensor.

## How it is decided

Fewer than 30 steps between the least and the largest value of a channel.

## What to do

Choose a smaller range of the sensor, move more, or declare the resolution as a source of kind `quantisation`.
"""

import numpy as np

from identify.judge.findings import Finding
from identify.results.declaration import ResidualCause
from identify.signals.run import Run

FEWEST = 30
"""Steps over a channel's range below which its resolution is coarse.

Choice: rounding then makes a hundredth of the range.
"""
SAME = 1e-6
"""Part of a channel's range within which samples are of one value.

Numerical: rounding of doubles.
"""


class CoarseChannel(Finding):
    """A channel with few different values."""

    quantity: str
    axis: str
    steps: int
    """Steps between its least and its largest value."""

    cure = "choose a smaller range of the sensor"

    @property
    def looks(self) -> str:
        return f"the {self.quantity} on {self.axis} has only {self.steps} steps over its range"


EXAMPLES = (CoarseChannel(topic="run.mcap", quantity="force", axis="b3", steps=12),)


def coarse(run: Run) -> list[ResidualCause]:
    """Return a finding on each channel of a run with few different values."""
    return [
        CoarseChannel(topic=run.name, quantity=quantity, axis=f"b{axis}", steps=steps).verdict(
            axis=f"b{axis}", share=0.0
        )
        for quantity in ("force", "moment", "omega")
        for axis, values in enumerate(getattr(run, quantity)[run.usable].T, 1)
        if 0 < (steps := _steps(values)) < FEWEST
    ]


def _steps(values: np.ndarray) -> int:
    """Number of steps over a channel's range; 0: it has one value."""
    gaps = np.diff(np.sort(values)) / max(float(np.ptp(values)), 1e-300)
    return int(np.count_nonzero(gaps > SAME))
