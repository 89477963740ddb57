"""All that the judge of a run may name: what the run looks as if, with its size, and the cure.

Causes are errors with a size. Any other finding is one file, in ``identify/judge/run_findings`` or
``identify/judge/conventions/findings``, whose docstring is its page and whose classes are its variants.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar, dataclass_transform

import numpy as np
from jaxtyping import Float

from identify.judge.cure import Cure, written
from identify.results.declaration import ResidualCause
from identify.rounding import significant, with_uncertainty

MATTERS = 0.5
"""Shift of a component over its standard uncertainty from which a finding is worth a warning.

Price: a standard uncertainty 12 % larger, ``hypot(1, 0.5)``.
"""
ROUNDING = 1e-9
"""Uncertainty over the largest of a cause's coefficients below which a coefficient is left at zero.

Numerical: rounding of doubles in the solution.
"""
ESTIMATED = ", or let method joint estimate it"
Size = Callable[[Float[np.ndarray, " p"], Float[np.ndarray, " p"]], str]
"""Function that writes the coefficients of a cause, in SI, with their standard uncertainties."""


def signed(value: float) -> str:
    """Return a number of two digits with its sign."""
    return significant(value, 2, signed=True)


def _all(scale: float, unit: str) -> Size:
    def write(values: np.ndarray, spread: np.ndarray) -> str:
        seen = spread > ROUNDING * spread.max()  # the others change nothing of what is compared
        pairs = zip(scale * values[seen], abs(scale) * spread[seen], strict=True)
        numbers = ", ".join(with_uncertainty(value, u) for value, u in pairs)
        return f"{numbers} {unit}" if len(values) == 1 else f"({numbers}) {unit}"

    return write


def _largest(scale: float, unit: str) -> Size:
    return lambda values, spread: f"{significant(scale * float(np.abs(values).max()), 2)} {unit}"


def _first(scale: float, unit: str) -> Size:
    return lambda values, spread: _all(scale, unit)(values[:1], spread[:1])


def _stiffness(values: np.ndarray, spread: np.ndarray) -> str:
    softest = float(values.max())
    if softest <= 0:
        return "the body or the load cell were bent by the load"
    return f"the body vibrated on its mounting, at about {significant(1 / (2 * np.pi * np.sqrt(softest)), 2)} Hz"


def _pull(values: np.ndarray, spread: np.ndarray) -> str:
    parts = ((values[:-9], "N/rad"), (values[-9:], "N·m/rad"))  # of a free body there is no force to compare
    return " and ".join(_largest(1.0, unit)(part, part) for part, unit in parts if part.size)


def _lateness(values: np.ndarray, spread: np.ndarray) -> str:
    if (values < 0).all():
        return f"the IMU lagged force and moment by {_all(-1e3, 'ms')(values, spread)}"
    return f"force and moment lagged by {_all(1e3, 'ms')(values, spread)}"


PAGE = "docs/explanation/troubles.md"
"""Page of the documentation with a row for each finding."""


def place_in_docs(label: str) -> str:
    """Return page and anchor of the documentation on a finding."""
    return f"{PAGE}#{label.replace(' ', '-')}"


class _Words:
    """Label, pattern of the text and cure of what the judge may name."""

    def __init__(self, label: str, pattern: str, cure: str, write_size: Size | None = None) -> None:
        """Name the parts of the member's value."""
        self.label, self.pattern, self.cure, self.write_size = label, pattern, cure, write_size

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return place_in_docs(self.label)

    def verdict(
        self, run: str, *, axis: str, share: float, text: str, changes: tuple[float, ...] = ()
    ) -> ResidualCause:
        """Return the finding on a run, in these words, with what it would add to the ten parameters."""
        return ResidualCause(
            cause=self.label, axis=axis, share=share, text=text, run=run, changes=changes, docs=self.docs
        )


class Cause(_Words, Enum):
    """An error that runs may follow: its label, pattern of its text, cure, and the function that writes its size."""

    DELAY = "delay", "the angular velocity lagged by {}", "declare the delay" + ESTIMATED, _all(1e3, "ms")
    ROTATION = (
        "rotation", "the IMU were rotated against the load cell by {}",
        "correct imu_rotation_to_body", _all(180 / np.pi, "deg")
    )  # fmt: skip
    CENTRE = "centre of gravity", "r_CG were off by {}", "correct r_cg_from_q, or record static poses", _all(-1e3, "mm")
    MASS = "mass", "the mass were off by {}", "weigh the body", _all(-1.0, "kg")
    WEIGHT_ALONE = (
        "weight", "the weight alone, not the inertia, were off by {}",
        "air or a cable that lifts it, or the accelerometer's scale? methods source and gls take the force as it is",
        _all(-1.0, "N")
    )  # fmt: skip
    STILL_MISSED = (
        "still missed", "the centre of gravity were off the point at rest by {}",
        "declare r_cg_from_omb with its uncertainty", _all(1e3, "mm")
    )  # fmt: skip
    GYRO_SCALE = (
        "gyro scale", "the gyro's scale factors were wrong by {}", "calibrate it, declare a scale, or check its unit",
        _all(-100.0, "%")
    )  # fmt: skip
    GYRO_BIAS = (
        "gyro bias", "the gyro's zero drifted by {}", "let it warm up, or declare a drift", _largest(1e3, "mrad/s²")
    )  # fmt: skip
    GYRO_AXES = (
        "gyro axes", "the gyro were rotated against the accelerometer by {}", "calibrate it, or declare a misalignment",
        _all(180 / np.pi, "deg")
    )  # fmt: skip
    GYRO_LATE = (
        "delay", "the gyro's axes lagged by {}", "give its axes the same filter, or declare the delay",
        _all(1e3, "ms")
    )  # fmt: skip
    GYRO_G = (
        "gyro g-sensitivity", "the gyro responded to acceleration, {}", "use the gyro's calibration",
        _largest(1e3, "mrad/s per m/s²")
    )  # fmt: skip
    GAIN = "gain", "the load cell's gains were wrong by {}", "calibrate it, or declare a scale", _all(100.0, "%")
    CROSS_TALK = (
        "cross-talk", "components of the load cell leaked into each other",
        "use its calibration matrix, or declare the cross_talk"
    )  # fmt: skip
    DRIFT = "drift", "the load cell's zeros drifted", "let it warm up, or declare a drift"
    WARMING = (
        "drift", "the load cell's zeros drifted as it warmed up",
        "let it warm up, declare a drift, or leave out the start of the run by --from"
    )  # fmt: skip
    JUMP = "jump", "the load cell's zeros jumped", "record again"
    SLIP = "slip", "the body slipped by {}", "clamp it, and record again", _largest(1e3, "mm")
    GAIN_DRIFT = "gain drift", "the load cell's gains changed by {} over the run", "let it warm up", _all(100.0, "%")
    CABLE = "cable", "a cable pulled with up to {}", "lay it loosely, or carry it along", _pull
    AIR = "air", "air or friction held the body back", "turn more slowly"
    FLEXIBLE_MOUNTING = "flexible mounting", "{}", "stiffen it, or move more slowly", _stiffness
    TENSOR = "tensor", "the tensor changed during the run: something moves", "fix what moves"
    ACCELEROMETER_PLACE = (
        "accelerometer place", "the accelerometer were displaced by {}", "correct imu_position", _all(1e3, "mm")
    )  # fmt: skip
    ACCELEROMETER_SCALE = (
        "accelerometer scale", "the accelerometer's scale factors were wrong by {}", "calibrate it", _all(-100.0, "%")
    )  # fmt: skip
    ACCELEROMETER_LATE = (
        "accelerometer delay", "the accelerometer lagged behind the gyro by {}",
        "set accelerometer_delay in [recording], or give both the same filter", _all(1e3, "ms")
    )  # fmt: skip
    CLOCK = "clock", "the IMU's clock drifted by {} over the run", "check the stamps", _first(1e3, "ms")
    FILTER = "filter", "{}", "give both sensors the same filter, or declare the delay" + ESTIMATED, _lateness
    NONLINEARITY = "nonlinearity", "the load cell were not linear", "use its calibration, or load it less"

    def phrase(self, values: Float[np.ndarray, " p"], spread: Float[np.ndarray, " p"]) -> str:
        """Return what a run looks like by a cause's coefficients, in SI, with their standard uncertainties."""
        written = "" if self.write_size is None else self.write_size(values, spread)
        return f"as if {self.pattern.format(written)} ({self.label})"


@dataclass_transform(kw_only_default=True, frozen_default=True, eq_default=False)
@dataclass(frozen=True, kw_only=True, eq=False)
class Finding(ABC):
    """A finding that is no error with a size: its figures as fields, and the texts that they make.

    The name of its file is its label. Several classes in a file are variants of one finding, each a frozen dataclass.
    """

    label: ClassVar[str]
    topic: str
    """Topic, run or file on which it is."""

    def __init_subclass__(cls) -> None:
        cls.label = cls.__module__.rpartition(".")[2].replace("_", " ")
        dataclass(frozen=True, kw_only=True, eq=False)(cls)

    @property
    @abstractmethod
    def looks(self) -> str:
        """Words for what the data look like."""

    @property
    @abstractmethod
    def cure(self) -> Cure | str:
        """Settings that cure it, or words on what to do."""

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return place_in_docs(self.label)

    @property
    def text(self) -> str:
        """One line on what it looks like, and on its cure."""
        return self.written()

    def written(self, map_keys: Collection[str] = ()) -> str:
        """Return the same for a run whose conventions stand in a map with these keys."""
        return f"{self.looks}: {written(self.cure, map_keys)}"

    def verdict(self, *, axis: str, share: float, adds: str = "") -> ResidualCause:
        """Return it as an entry of a result.

        Args:
            axis: b1, b2 or b3; empty: none.
            share: part of the residuals' variance.
            adds: what it does to the tensor.
        """
        text = f"{self.topic}: {self.looks} ({self.label}); {written(self.cure)}{adds}"
        return ResidualCause(cause=self.label, axis=axis, share=share, text=text, run=self.topic, docs=self.docs)
