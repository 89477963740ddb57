"""The centre of gravity is elsewhere than stated.

Looks like: a moment as of the force times a lever arm. Matters: the tensor errs by the mass times distance times arm.
Do: correct ``r_cg_from_q``, or record static poses, from which it follows.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# a drawing
TYPICAL = TypicalSize(
    figure=0.001, key_unit="m", text="error of r_CG", unit="mm", per_si=1e3,
    about="Error of the centre of gravity on each axis, where the estimate takes it as exact.",
)  # fmt: skip


def act(state: RigState, metres: Numbers) -> RigState:
    """Return the state of a body whose centre of gravity is off from where it is believed, in B."""
    return state.with_less("r_cg", metres)


CENTRE_OF_GRAVITY = ErrorModel(
    name="centre_of_gravity", count=3, act=act, linear=True, stage=Stage.BODY,
    part="body", needs=frozenset({"mounting"}), unknowns=("r_cg",),
    by_hand=True, declared_as=("r_cg", "bias"), typical=TYPICAL, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "centre of gravity", "r_CG were off by {}", "correct r_cg_from_q, or record static poses", every(-1e3, "mm")
    ),
)  # fmt: skip
