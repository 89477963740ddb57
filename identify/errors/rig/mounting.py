"""The body vibrates on a mounting that bends, while load cell and IMU do not turn with it.

Looks like: inertia that grows with the square of the motion's frequency. Matters: a mounting of 50 Hz turns the body by
the square of the ratio of frequencies, 0.3 % of its acceleration at 2.5 Hz. Do: stiffen it, or move more slowly.
"""

from dataclasses import replace

import numpy as np

from identify.display.rounding import significant
from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState, TrueMotion
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import cross_matrix
from identify.rigid_body.rotation import exponential


def _numbers(hertz: float) -> np.ndarray:
    """Flexibility that is the same about all axes."""
    return np.full((3, 1), (2 * np.pi * hertz) ** -2)


# hexapods and adapters
TYPICAL = TypicalSize(
    figure=50.0, key_unit="Hz", text="flexibility of the mounting", unit="Hz", per_si=1.0,
    numbers=_numbers, signed=True,
    about="Frequency of the body's vibration on its mounting about each axis; load cell and IMU stay on "
    "the platform's side.",
)  # fmt: skip


def act(state: RigState, flexibility: Numbers) -> RigState:
    """Return the state of a body on springs about each axis, of its angular frequency on them to the power −2 [s²].

    The moment M about Q turns the body by −M / (I_Q ω₀²) from its attitude at rest.
    """
    true, r = state.true, state.true.r_cg
    about_q = true.inertia[[0, 3, 5]] + true.mass * (r @ r - r**2)
    moments = state.wrench[:, 3:] - state.wrench[:, 3:].mean(axis=0), *(w[:, 3:] for w in state.slopes("wrench", 2))
    angle, rate, acceleration = (-moment / about_q * flexibility for moment in moments)
    turn, at_q = exponential(angle), true.specific_force - _lever(true)
    to_body = lambda vectors: np.einsum("nji,nj->ni", turn, vectors)  # noqa: E731
    omega = to_body(true.omega)
    moved = replace(
        true, omega=omega + rate, alpha=to_body(true.alpha) - np.cross(rate, omega) + acceleration,
        specific_force=to_body(at_q),
    )  # fmt: skip
    force, on_body = np.split(_from_q(moved), 2, axis=1)
    back = [np.einsum("nij,nj->ni", turn, vectors) for vectors in (force, on_body)]
    return state.with_added(np.hstack(back) - _from_q(replace(true, specific_force=at_q)))


def _lever(true: TrueMotion) -> np.ndarray:
    """The acceleration of the centre of gravity from Q."""
    across = cross_matrix(true.r_cg)
    return true.alpha @ across + np.cross(true.omega, true.omega @ across)


def _from_q(true: TrueMotion) -> np.ndarray:
    """Force and moment about Q, with the specific force of Q in place of that of the centre of gravity."""
    force, tensor = true.mass * (true.specific_force + _lever(true)), unpack(true.inertia)
    spin = true.alpha @ tensor + np.cross(true.omega, true.omega @ tensor)
    return np.hstack([force, spin + force @ cross_matrix(true.r_cg).T])


def _stiffness(values: np.ndarray, spread: np.ndarray) -> str:
    softest = float(values.max())
    if softest <= 0:
        return "the body or the load cell were bent by the load"
    return f"the body vibrated on its mounting, at about {significant(1 / (2 * np.pi * np.sqrt(softest)), 2)} Hz"


MOUNTING = ErrorModel(
    name="mounting_frequency", count=3, act=act, stage=Stage.SURROUNDINGS,
    part="rig", needs=frozenset({"mounting"}), unknowns=("mounting_frequency",), typical=TYPICAL,
    prior=part_of_wrench(0.01),
    words=CauseWords("flexible mounting", "{}", "stiffen it, or move more slowly", _stiffness),
)  # fmt: skip
