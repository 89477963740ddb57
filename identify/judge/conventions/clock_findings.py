"""Stamps of load cell and motion that are of two clocks, by the log's times and by which of the two fits."""

import numpy as np

from identify.judge.conventions import convention_fit
from identify.judge.conventions.convention_fit import (
    FORCE,
    FORCE_TERMS,
    MOMENT,
    MOMENT_TERMS,
    SPECIFIC,
    ConventionSums,
    ImuSignal,
    WrenchSignal,
    convention_sums,
)
from identify.judge.findings import Contradiction, Finding
from identify.rounding import fixed

LEAST_OFFSET = 0.05
"""Difference between the delays from stamp to log that is worth a look [s].

Choice: messages of one computer wait less for one another, but where they are sent in bundles.
"""
FITS = 0.1
"""Part of the changes of force and moment that is left where the stamps fit, root mean square.

Choice: ten times what a good fit leaves.
"""
LONGEST_DELAY = 10.0
"""Delay from which none is named that method ``joint`` could take [s].

Definition: the limit of ``delay`` in an experiment file.
"""
BETTER = 2.0
"""Factor by which the log's times must lower what is left.

Choice: 0.05 s apart, a motion of 1 Hz leaves three times as much.
"""


def clock_findings(
    wrench: WrenchSignal, imu: ImuSignal, early: float, topic: str, delay: float = 0.0
) -> list[Contradiction]:
    """Return the finding that stamps are of two clocks, where they are.

    Args:
        wrench: of the run, by its stamps.
        imu: the same.
        early: time by which the IMU's stamps are early by the log's times [s].
        topic: of the IMU.
        delay: of the IMU, as declared, which ``imu`` and ``early`` are without [s].
    """
    if abs(early) < LEAST_OFFSET:
        return []
    by_stamps, by_log = (_left(convention_sums(wrench, imu._replace(time=imu.time + shift))) for shift in (0.0, early))
    if by_stamps < FITS or (by_log < np.inf and by_log > by_stamps):
        return []
    doubt = "" if by_log * BETTER < by_stamps else "; force and motion do not confirm or refute it"
    figures = {"offset": fixed(abs(early), 3), "early": "early" if early > 0 else "late", "doubt": doubt}
    cure = delay - early
    lines = f', or, of method joint, delay = "{cure:.3f} s"' if abs(cure) < LONGEST_DELAY else ""
    return [Finding.CLOCKS_APART.on(topic, lines=lines, **figures)]


def _left(sums: ConventionSums | None) -> float:
    """Part of the changes of force and moment that no body explains; infinite where there is too little to judge."""
    if sums is None:
        return np.inf
    fits = [(MOMENT, MOMENT_TERMS)] + [(FORCE, FORCE_TERMS)] * (sums.size(SPECIFIC) > 0)
    parts = [
        convention_fit.variance_left(sums, terms, columns) / max(float(sums.changes(columns)), 1e-18)
        for columns, terms in fits
    ]
    return float(np.sqrt(np.mean(parts)))
