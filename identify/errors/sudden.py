"""Sudden changes during a run, at instants that stand for all between them."""

import numpy as np
from jaxtyping import Float

from identify.errors.rig_state import TrueMotion

STEPS = (-0.25, 0.0, 0.25)
"""Instants at which a sudden change is assumed, in parts of the run from its middle.

Choice: three, which a change between them still resembles.
"""


def after_steps(true: TrueMotion) -> Float[np.ndarray, "n steps"]:
    """Return one after each of :data:`STEPS`, and zero before."""
    return np.stack([true.progress > at for at in STEPS], axis=1).astype(float)
