"""The end of a sensor's range: samples that stay at an extreme value."""

import numpy as np
from jaxtyping import Float

from identify.judge.findings import Finding
from identify.results.residual_cause import ResidualCause
from identify.rounding import significant
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


def saturated(run: Run) -> list[ResidualCause]:
    """Return a finding for each end of each channel at which samples stay that are not left out."""
    return [
        Finding.SATURATION.cause(
            run.name, axis=f"b{axis}", share=count / len(values), quantity=name, value=significant(end, 4), count=count
        )
        for quantity, name in QUANTITIES.items()
        for axis, values in enumerate(getattr(run, quantity)[run.usable].T, 1)
        for end in (values.min(), values.max())
        if (count := _at_end(values, end))
    ]


def _at_end(values: Float[np.ndarray, " n"], end: float) -> int:
    """Count of samples that stay at an extreme value; 0: no more than noise or a coarse resolution brings there."""
    away = np.abs(values - end)
    width = ONE_VALUE * away.max()
    count, beyond = int(np.count_nonzero(away <= width)), away[away > width]
    if count < FLAT or not len(beyond) or np.ptp(beyond) <= width:  # a signal of two values is no clipped one
        return 0
    return count if count > OVER_NEXT * np.count_nonzero(beyond <= beyond.min() + width) else 0
