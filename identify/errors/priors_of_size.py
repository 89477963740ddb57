"""Sizes that the judge expects of an error in a run."""

import numpy as np

from identify.errors.error_model import Columns, Numbers, Prior
from identify.errors.rig_state import RigState


def fixed(*sizes: float) -> Prior:
    """Return the prior of numbers whose sizes do not depend on the run, in SI."""
    return lambda state, columns: np.array(sizes)


def part_of_wrench(part: float) -> Prior:
    """Return the prior of additions to the wrench, each as large as a part of the wrench's changes."""

    def sizes(state: RigState, columns: Columns) -> Numbers:
        changes, rms = largest_of_three(state.wrench.std(axis=0)), np.sqrt((columns**2).mean(axis=0))
        endless = np.full(rms.shape, np.inf)
        ratio = np.divide(changes[:, None], rms, out=endless, where=rms > 1e-12 * rms.max())
        size = part * ratio.min(axis=0)
        return np.where(np.isfinite(size), size, 0.0)

    return sizes


def largest_of_three(sizes: np.ndarray) -> np.ndarray:
    """Return the largest of force and of moment, on each of their rows."""
    return np.repeat([sizes[:3].max(), sizes[3:].max()], 3)


def full_scale(state: RigState) -> np.ndarray:
    """Return the root mean square of the largest force and moment, on each of their rows [N], [N·m]."""
    return largest_of_three(np.sqrt((state.wrench**2).mean(axis=0)))
