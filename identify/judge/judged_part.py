"""The part of a run that is judged: the estimate takes every sample, what contradicts it shows in fewer."""

import numpy as np

from identify.signals.run import Run

PERIODS = (1_500, 5_000)
"""Periods of the motion's highest frequency that are judged, at least and at most.

Choice: ten minutes of a motion up to 2.5 Hz; at most half a gigabyte of memory. Price: an error that begins later, or
that only a longer run resolves, is not named. Measured: of 24 runs of twelve minutes the same is named as of all of
each in 21 (``benchmarks.studies.judged_part``).
"""
ENOUGH = 60.0
"""Seconds that are judged where the periods leave the choice: what vibrates makes the highest frequency high [s].

Choice: twice a usual run.
"""


def judged_samples(band: float, rate: float) -> int:
    """Return the number of samples that are judged.

    Args:
        band: highest frequency of the motion [Hz].
        rate: sample rate [Hz].
    """
    least, most = (periods / band for periods in PERIODS)
    return int(min(max(ENOUGH, least), most) * rate)


def judged_part(run: Run, band: float) -> Run:
    """Return the first part of a run, with as many samples that may be used as are judged.

    Args:
        run: the run.
        band: highest frequency of the motion [Hz].
    """
    usable, count = np.flatnonzero(run.usable), judged_samples(band, run.rate)
    return run if len(usable) <= count else run.between(run.t[0], run.t[usable[count - 1]])
