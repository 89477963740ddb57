"""Local gravity is not what is stated.

Looks like: weight without the inertia of its mass, where the base is at rest. Matters: the weight's moment is taken for
inertia. Do: state ``platform.gravity`` of the place.
"""

from identify.errors.error_model import ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.rig_state import RigState

# from the equator to the poles
TYPICAL = TypicalSize(
    figure=0.015, key_unit="m/s^2", text="error of gravity", unit="m/s²", per_si=1.0,
    about="Local gravity less the stated one.",
)  # fmt: skip


def act(state: RigState, more: Numbers) -> RigState:
    """Return the state where gravity is so much more than is believed [m/s²]."""
    return state.with_less("gravity", more)


GRAVITY = ErrorModel(
    name="gravity", count=1, act=act, linear=True, stage=Stage.SURROUNDINGS,
    part="rig", unknowns=("gravity",), by_hand=True, declared_as=("gravity", "bias"),
    typical=TYPICAL,
)  # fmt: skip
