"""The accelerometer is elsewhere than stated.

Looks like: specific force as of the acceleration of a lever arm. Matters: force and moment at the centre of gravity err
by it. Do: correct ``imu_position``.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# a ruler to the housing
TYPICAL = TypicalSize(
    figure=0.002, key_unit="m", text="place of the accelerometer", unit="mm", per_si=1e3,
    about="Error of the accelerometer's place (imu_position) on each axis, where the estimate takes the "
    "specific force from it.",
)  # fmt: skip


def act(state: RigState, metres: Numbers) -> RigState:
    """Return the state of an accelerometer that is off from where it is believed, in B."""
    return state.with_less("imu_position", metres)


ACCELEROMETER_PLACE = ErrorModel(
    name="accelerometer_place", count=3, act=act, linear=True, stage=Stage.BODY,
    part="accelerometer", needs=frozenset({"accelerometer"}), unknowns=("accelerometer_place",),
    declared_as=("accelerometer", "place"),
    typical=TYPICAL, replaced_by_cause=True, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "accelerometer place", "the accelerometer were displaced by {}", "correct imu_position", every(1e3, "mm")
    ),
)  # fmt: skip
