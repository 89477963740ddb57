"""The centre of gravity is off the point that keeps still.

Looks like: a force as of the acceleration of a lever arm. Matters: specific force and moment at the centre of gravity
err by it. Do: declare ``r_cg_from_omb`` with its uncertainty.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every


def act(state: RigState, metres: Numbers) -> RigState:
    """Return the state of a body whose centre of gravity is off from where it is believed to the point at rest."""
    return state.with_less("cg_from_still", metres)


STILL_POINT = ErrorModel(
    name="still_point", count=3, act=act, linear=True,
    stage=Stage.BODY, part="body", unknowns=("cg_from_still",), by_hand=True,
    prior=fixed(*[0.02] * 3), declared_as=("r_cg_from_omb", "bias"),
    words=CauseWords(
        "still missed", "the centre of gravity were off the point at rest by {}",
        "declare r_cg_from_omb with its uncertainty", every(1e3, "mm"),
    ),
)  # fmt: skip
