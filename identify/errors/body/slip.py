"""The body slips on its mounting during a run.

Looks like: another centre of gravity from one instant on. Matters: neither part of the run has the mean's arm. Do:
clamp it, and record again.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.sudden import STEPS, after_steps
from identify.errors.written_sizes import largest


def act(state: RigState, metres: Numbers) -> RigState:
    """Return the state of a body that slips by three numbers at each of three instants, numbers of an axis together."""
    return state.with_less("r_cg", after_steps(state.true) @ metres.reshape(3, len(STEPS)).T)


SLIP = ErrorModel(
    name="slip", count=3 * len(STEPS), act=act, linear=True, stage=Stage.BODY,
    part="body", scope="run", needs=frozenset({"mounting"}),
    prior=fixed(*[1e-3] * 3 * len(STEPS)),
    words=CauseWords("slip", "the body slipped by {}", "clamp it, and record again", largest(1e3, "mm")),
)  # fmt: skip
