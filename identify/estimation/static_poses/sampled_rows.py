"""Rows of a table that are samples of a motion and no poses, and the angular velocity that their attitudes show."""

import numpy as np
from jaxtyping import Float

from identify.signals.filters import moving_average

STEPS = 5
"""Steps in succession that are looked at together."""
BLOCKS = (1, 10, 100)
"""Rows whose mean counts as one, so that a motion shows below the attitudes' noise."""
STRAIGHT = 0.9
"""Part of the way of some steps in succession that they lead on, in a motion; noise leads on by a third."""
EVEN = 0.4
"""Largest step over all of them in a motion; a change between two poses is one step, or two where a block holds it."""
SMALL = np.radians(5)
"""Way [rad] of some steps in succession, above which they are poses: a platform is tilted by a degree or more."""
LEAST = 1e-5
"""Way [rad] that counts as none: rounding."""
LEAST_ROWS = 100
"""A shorter table holds poses."""
PART = 0.01
"""Part of the rows in motion, above which the table is a record of it."""
SECONDS = 0.5
"""Time over which a direction's change counts [s]."""


def sampled(upward: Float[np.ndarray, "n 3"]) -> bool:
    """Return whether rows are samples of a motion: successive directions lead on, in small and even steps.

    Args:
        upward: upward direction by each row's attitude, of any length, in the sensor's frame.
    """
    if len(upward) < LEAST_ROWS:
        return False
    unit = upward / np.maximum(np.linalg.norm(upward, axis=1, keepdims=True), 1e-300)
    return any(_in_motion(unit, size) > PART for size in BLOCKS)


def turning(upward: Float[np.ndarray, "n 3"], rate: float) -> Float[np.ndarray, "n 3"]:
    """Return the angular velocity that turns a direction, in its frame, averaged over half a second [rad/s].

    Args:
        upward: a direction that is fixed in space, of any length.
        rate: of the rows [Hz].
    """
    unit = upward / np.linalg.norm(upward, axis=1, keepdims=True)
    smooth = moving_average(unit, int(np.clip(round(SECONDS * rate), 1, len(unit))), ends="edge")
    return np.cross(np.gradient(smooth, 1 / rate, axis=0), smooth)


def _in_motion(unit: Float[np.ndarray, "n 3"], size: int) -> float:
    """Part of the rows in motion, by means of so many rows."""
    count = len(unit) // size
    if count <= STEPS:
        return 0.0
    means = unit[: count * size].reshape(count, size, 3).mean(axis=1)
    steps = np.linalg.norm(np.diff(means, axis=0), axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(steps, STEPS)
    way, largest = windows.sum(axis=1), windows.max(axis=1)
    direct = np.linalg.norm(means[STEPS:] - means[:-STEPS], axis=1)
    moves = (direct > STRAIGHT * way) & (largest < EVEN * way) & (way > LEAST) & (way < SMALL)
    return float(moves.mean())
