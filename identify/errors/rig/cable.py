"""A cable pulls at the body.

Looks like: force and moment that follow the attitude. Matters: a pull in phase with the angular acceleration is taken
for inertia. Do: lay it loosely, or carry it along.
"""

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import largest


def act(state: RigState, stiffness: Numbers) -> RigState:
    """Return the state with force and moment linear in the attitude, by rows [N/rad], [N·m/rad]."""
    return state.with_added(state.true.turning @ stiffness.reshape(6, 3).T)


def _pull(values: np.ndarray, spread: np.ndarray) -> str:
    parts = ((values[:-9], "N/rad"), (values[-9:], "N·m/rad"))  # of a free body there is no force to compare
    return " and ".join(largest(1.0, unit)(part, part) for part, unit in parts if part.size)


CABLE = ErrorModel(
    name="cable", count=18, act=act, linear=True,
    stage=Stage.SURROUNDINGS, part="rig", scope="run", needs=frozenset({"mounting"}),
    prior=part_of_wrench(0.02),
    words=CauseWords("cable", "a cable pulled with up to {}", "lay it loosely, or carry it along", _pull),
)  # fmt: skip
