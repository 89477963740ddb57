"""Samples that a sensor did not really take: held and frozen ones, and those at the end of its range.

A value that comes again is suspicious only if the signal moves: in a simulation without noise, equal samples follow one
another at rest. What tells is a step: a held or clipped signal comes and goes with one.
"""

import numpy as np
from jaxtyping import Bool, Float

from identify.signals.segments import runs_of_true

FROZEN = 5
"""Equal samples in a row that are no chance with any noise."""
HELD = 0.2
"""Part of equal samples that is no chance: one in five comes from a slower source."""
STEP = 0.1
"""Step out of a plateau, as a part of the signal's usual one, that shows that the signal had moved meanwhile."""


def held(values: Float[np.ndarray, "n k"]) -> Bool[np.ndarray, " n"]:
    """Return which samples repeat the one before in every column, while the signal moved."""
    same = np.zeros(len(values), bool)
    same[1:] = values[1:, 0] == values[:-1, 0]
    for column in values.T[1:] if same.any() else ():
        same[1:] &= column[1:] == column[:-1]
    if not same.any() or same[1:].all():
        return np.zeros(len(values), bool)
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    usual = float(np.median(steps[steps > 0]))
    out = np.concatenate([steps, [0.0]])
    repeated = np.zeros(len(values), bool)
    for start, stop in runs_of_true(same):
        repeated[start:stop] = out[stop - 1] >= STEP * usual
    return repeated


def repeats(values: Float[np.ndarray, "n k"]) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return which samples to drop, as the sensor is slower than its messages; and where it stood still for a while."""
    equal, none = held(values), np.zeros(len(values), bool)
    if equal.mean() > HELD:
        return _every(values, np.median([stop - start for start, stop in runs_of_true(equal)])), none
    frozen = none.copy()
    for start, stop in runs_of_true(equal):
        frozen[start - 1 : stop] = stop - start + 1 >= FROZEN
    return none, frozen


def _every(values: np.ndarray, usual: float) -> np.ndarray:
    """All repeats of a slower source, also where it happened to move little: runs of up to twice the usual length."""
    same = np.concatenate([[False], (np.diff(values, axis=0) == 0).all(axis=1)])
    for start, stop in runs_of_true(same):
        same[start:stop] = stop - start <= 2 * usual
    return same


def saturated(values: Float[np.ndarray, "n k"]) -> Bool[np.ndarray, " n"]:
    """Return which samples stay exactly at a column's largest or smallest value, five or more in a row."""
    clipped = np.zeros(len(values), bool)
    for column in values.T:
        extremes = [column == extreme for extreme in (column.min(), column.max())]
        extremes = [at_end for at_end in extremes if FROZEN <= at_end.sum() < len(column)]
        steps = np.abs(np.diff(column)) if extremes else np.zeros(1)
        usual = float(np.median(steps[steps > 0])) if extremes else 0.0
        for at_end in extremes:
            for start, stop in runs_of_true(at_end):
                ends = [steps[k] for k in (start - 1, stop - 1) if 0 <= k < len(steps)]
                clipped[start:stop] |= stop - start >= FROZEN and max(ends) >= STEP * usual
    return clipped
