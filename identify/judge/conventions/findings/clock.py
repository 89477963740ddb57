"""The stamps of load cell and motion are of two clocks.

## What it looks like

By the times at which the log has the messages, those of the motion are stamped early or late against those of the
wrench, by 0.05 s or more. (A clock that drifts over the run is a cause of this name, with a size.)

## Why it matters

Force and moment are compared with the motion of another instant. Nothing that is identified then is right.

## How it is decided

By the stamps, force and moment keep a tenth of their changes that no rigid body explains, and the log's times explain
them at least as well. Where these do not halve what is left, the message says that force and motion do not confirm it.

## What to do

Set `time = "log"` in `[recording]`: the log's times are of one clock, where two computers stamp by clocks of their
own. Or with method `joint` declare the `delay`, which it then refines. Better: synchronise the clocks, and record
again.
"""

import numpy as np

from identify.display.rounding import fixed
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
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding

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


class TwoClocks(Finding):
    """Stamps of wrench and motion by clocks that are apart."""

    early: float
    """Time by which the motion's stamps are early [s]."""
    confirmed: bool
    """Whether force and motion confirm it."""
    delay: float | None
    """Delay of the motion that method ``joint`` could take instead [s]; None: it is too long."""

    @property
    def looks(self) -> str:
        doubt = "" if self.confirmed else "; force and motion do not confirm or refute it"
        apart = f"{fixed(abs(self.early), 3)} s {'early' if self.early > 0 else 'late'}"
        return f"by the log's times the stamps of the motion are {apart} against the wrench's{doubt}"

    @property
    def cure(self) -> Cure:
        delay = "" if self.delay is None else Entries({"delay": f"{self.delay:.3f} s"}).line
        then = f", or, of method joint, {delay}" * bool(delay)
        return Cure(question="two computers?", choices=[Entries({"time": "log"})], then=then)


EXAMPLES = (TwoClocks(topic="/imu", early=0.412, confirmed=True, delay=-0.412),)


def clock_findings(wrench: WrenchSignal, imu: ImuSignal, early: float, topic: str, delay: float = 0.0) -> list[Finding]:
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
    confirmed, cure = by_log * BETTER < by_stamps, delay - early
    return [TwoClocks(topic=topic, early=early, confirmed=confirmed, delay=cure if abs(cure) < LONGEST_DELAY else None)]


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
