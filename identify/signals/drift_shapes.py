"""Shapes in time of a zero that drifts as its sensor warms up."""

import numpy as np
from jaxtyping import Float

TIMES = (0.5, 0.125, 0.03)
"""Time constants with which a load cell's zero warms up, in parts of the run.

Choice: three, with a straight line within 0.8 % of any exponential of a fortieth of the run or more.
"""


def drift_shapes(time: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4"]:
    """Return what the drift of a zero consists of: a straight line, then exponentials, from the start to the end."""
    progress = (time - time[0]) / (time[-1] - time[0])
    return np.stack([progress, *(np.exp(-progress / part) for part in TIMES)], axis=1)
