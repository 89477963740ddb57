"""The record of one error of the rig: its physics, size, words and scope."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum, auto
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.display.reporting import place_in_docs
from identify.errors.rig_state import Beliefs, RigState, TrueMotion
from identify.errors.written_sizes import WrittenSize

Numbers = Float[np.ndarray, " p"]
Columns = Float[np.ndarray, "n 6 p"]
Prior = Callable[[RigState, Columns], Numbers]
"""Function that gives the typical sizes of an error's numbers in a run, from that run and what a unit of each adds."""
CELL_MATRIX = ("cell_matrix",)
"""Unknown of the joint model that holds all that mixes the load cell's channels."""
STEP = 2.0**-17
"""Step of central differences, in SI.

Numerical: of an error that is smooth over 1 rad or 1 s, the term of third order is 1e-11, and rounding as much.
"""
STEP_OF_UNITS = 2.0**-26
"""Step of central differences of unit wrenches, which is exact: no rounding hides it, and its square is below."""


class Stage(IntEnum):
    """Places of the rig in the order in which errors act: from the body to the files.

    The load cell turns, mixes and scales what acts on it before it adds a zero; so does the IMU, whose stamps err last.
    """

    BODY = auto()
    SURROUNDINGS = auto()
    CELL_AXES = auto()
    CELL_CROSS_TALK = auto()
    CELL_GAIN = auto()
    CELL_FILTER = auto()
    CELL_ZERO = auto()
    IMU_AXES = auto()
    SENSOR_AXES = auto()
    SENSOR_GAIN = auto()
    SENSOR_FILTER = auto()
    SENSOR_ZERO = auto()
    STAMPS = auto()
    START = auto()


@dataclass(frozen=True, kw_only=True)
class TypicalSize:
    """Typical size of an error that nobody declares: a standard uncertainty, known to some 30 to 50 %.

    docs/how-to/identify.md says what data sheets and studies the figures are from.
    """

    figure: float
    """Figure in SI, relative ones in parts of one."""
    key_unit: str
    """Unit of the key in ``[undeclared]`` of an experiment file."""
    about: str
    """Sentence on the key."""
    text: str
    """Words of the report."""
    unit: str
    """Unit of the report."""
    per_si: float
    """Factor from SI to the unit."""
    numbers: Callable[[float], Float[np.ndarray, "p k"]] | None = None
    """Function from a figure in SI to the error's numbers, a column for each that errs by itself; None: each errs by
    the figure."""
    counts: bool = True
    """Whether it counts where `[undeclared]` does not state it."""
    signed: bool = False
    """Whether the error's sign is known, so that its effect is a bias."""


class CauseWords(NamedTuple):
    """Words by which the judge names an error."""

    label: str
    pattern: str
    """Pattern of what the run looks as if, with a place for the size."""
    cure: str
    write_size: WrittenSize | None = None

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return place_in_docs(self.label)

    def phrase(self, values: Numbers, spread: Numbers) -> str:
        """Return what a run looks like by an error's numbers, in SI, with their standard uncertainties."""
        written = "" if self.write_size is None else self.write_size(values, spread)
        return f"as if {self.pattern.format(written)} ({self.label})"


NO_WORDS = CauseWords("", "", "")


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorModel:
    """One error of the rig, whatever is known of it: declared, typical, estimated or named."""

    name: str
    """Name of the error, and its key in ``[undeclared]``."""
    count: int
    """Count of its numbers."""
    act: Callable[[RigState, Numbers], RigState]
    """Function that lets the error act: nothing at zero."""
    stage: Stage
    """Place in the chain, before and after which others act."""
    part: Literal["body", "rig", "load cell", "gyro", "accelerometer", "imu"]
    """Part of the rig that errs."""
    scope: Literal["rig", "run"] = "rig"
    """Owner of one value: the rig in all runs, or each run."""
    linear: bool = False
    """Whether it acts in proportion to its numbers, so that one step of any size tells the derivative."""
    needs: frozenset[str] = frozenset()
    """Conditions without which it cannot be: ``mounting`` (or weight), a load cell's ``zero``, an ``accelerometer``
    that tells the specific force."""
    unknowns: tuple[str, ...] = ()
    """Unknowns of :data:`identify.estimation.joint.joint_model.SIZES` by which the joint estimate has it."""
    by_hand: bool = False
    """Whether the joint model's derivatives by these unknowns are the error's."""
    declared_as: tuple[str, str] | None = None
    """Target and kind of a source that declares it."""
    typical: TypicalSize | None = None
    """Size where it is not declared; None: it does not count then."""
    replaced_by_cause: bool = False
    """Whether the runs show all of its numbers, so that what they show takes the place of the typical size."""
    prior: Prior | None = None
    """Function to the sizes that the judge expects; None: the judge does not look for it."""
    words: CauseWords = NO_WORDS
    """Words of the judge, where it looks for the error."""

    @property
    def label(self) -> str:
        """Label of the cause in ``consistency``."""
        return self.words.label

    def typical_numbers(self, figure: float) -> Float[np.ndarray, "p k"]:
        """Return the error's numbers by a figure of ``[undeclared]``, a column for each that errs by itself."""
        if self.typical is None or self.typical.numbers is None:
            return figure * np.eye(self.count)
        return self.typical.numbers(figure)

    def derivatives(self, state: RigState, step: float = STEP) -> dict[str, np.ndarray]:
        """Return the derivatives, at no error, of the parts of a state on which it acts, a last axis for its numbers.

        By central differences, or by one step that is exact; the parts' names are those of :attr:`RigState.parts`.
        """
        before, derivatives = state.parts, dict[str, np.ndarray]()
        for number, unit in enumerate(np.eye(self.count)):
            after = self.act(state, unit if self.linear else step * unit).parts
            less = before if self.linear else self.act(state, -step * unit).parts
            for name, part in before.items():
                if after[name] is not part:
                    columns = derivatives.setdefault(name, np.zeros((*part.shape, self.count)))
                    columns[..., number] = (after[name] - less[name]) / (1.0 if self.linear else 2 * step)
        return derivatives

    @cached_property
    def by_cell_matrix(self) -> Float[np.ndarray, "36 p"]:
        """Derivative of the load cell's matrix, row by row, by the error's numbers.

        Raises:
            ValueError: the error is none of the load cell's matrix.
        """
        if self.unknowns != CELL_MATRIX:
            raise ValueError(f"Argument `self` must mix the load cell's channels, but is {self.name!r}.")
        by_number = self.derivatives(UNIT_WRENCHES, STEP_OF_UNITS)["wrench"]
        return np.asarray(by_number.swapaxes(0, 1).reshape(36, self.count))


def composed(errors: Iterable[ErrorModel], state: RigState, numbers: Mapping[str, Numbers]) -> RigState:
    """Return the state with several errors at once, in the order of their stages.

    Args:
        errors: any, of which those act that have numbers.
        state: without them.
        numbers: of each error that acts, by its name, in SI.
    """
    for error in sorted(errors, key=lambda error: error.stage):
        if error.name in numbers:
            state = error.act(state, np.asarray(numbers[error.name], float))
    return state


_NONE, _ZERO = np.zeros((6, 3)), np.zeros((6, 1))
UNIT_WRENCHES = RigState(
    true=TrueMotion(
        t=np.arange(6.0), duration=5.0, omega=_NONE, alpha=_NONE, specific_force=_NONE, up=_NONE, turning=_NONE,
        mass=0.0, r_cg=np.zeros(3), inertia=np.zeros(6),
    ),
    beliefs=Beliefs(
        mass=_ZERO, r_cg=_NONE, inertia=np.zeros((6, 6)), gravity=_ZERO, cg_from_still=_NONE, imu_position=_NONE
    ),
    wrench=np.eye(6), gyro=_NONE, gyro_slope=_NONE, accelerometer=_NONE, vertical=np.zeros(3), imu_turn=np.eye(3),
)  # fmt: skip
"""A body at rest with a unit of each component of the wrench, one after another: they show the load cell's matrix."""
