"""The load cell is not linear.

Looks like: a channel with the square of its component. Matters: the weight's offset gives the motion another gain. Do:
use its calibration, or load it less.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState


def act(state: RigState, squares: Numbers) -> RigState:
    """Return the state of a load cell that adds so much of each component's square [1/N], [1/(N·m)]."""
    return state.with_added(state.wrench**2 * squares)


NONLINEARITY = ErrorModel(
    name="nonlinearity",
    count=6,
    act=act,
    linear=True,
    stage=Stage.CELL_GAIN,
    part="load cell",
    prior=part_of_wrench(0.005),
    words=CauseWords("nonlinearity", "the load cell were not linear", "use its calibration, or load it less"),
)
