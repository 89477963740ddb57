"""All that a result's judge may name: what a run looks as if, with its size, and the cure.

The members of :class:`Finding` are the messages, for terminal, ``result.json`` (``consistency``) and
docs/explanation/troubles.md alike.
"""

from collections.abc import Callable
from enum import Enum

import numpy as np
from jaxtyping import Float

from identify.results.residual_cause import ResidualCause
from identify.rounding import significant, with_uncertainty

MATTERS = 0.5
"""Shift of a component over its standard uncertainty from which a finding is worth a warning.

Price: a standard uncertainty 12 % larger, ``hypot(1, 0.5)``.
"""
ROUNDING = 1e-9
"""Uncertainty over the largest of a cause's coefficients below which a coefficient is left at zero."""
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


def _none(values: np.ndarray, spread: np.ndarray) -> str:
    return ""


def _stiffness(values: np.ndarray, spread: np.ndarray) -> str:
    softest = float(values.max())
    if softest <= 0:
        return "body or load cell bent under it"
    return f"the body bent on its mounting, at about {significant(1 / (2 * np.pi * np.sqrt(softest)), 2)} Hz"


def _pull(values: np.ndarray, spread: np.ndarray) -> str:
    parts = ((values[:-9], "N/rad"), (values[-9:], "N·m/rad"))  # of a free body there is no force to compare
    return " and ".join(_largest(1.0, unit)(part, part) for part, unit in parts if part.size)


def _lateness(values: np.ndarray, spread: np.ndarray) -> str:
    if (values < 0).all():
        return f"the IMU came late by {_all(-1e3, 'ms')(values, spread)} against force and moment"
    return f"force and moment came late by {_all(1e3, 'ms')(values, spread)}"


class Finding(Enum):
    """A finding: its label, the pattern of its text, the function that writes a cause's size into it, the cure."""

    DELAY = "delay", "the angular velocity came late by {}", _all(1e3, "ms"), "declare the delay" + ESTIMATED
    ROTATION = (
        "rotation", "the IMU were turned against the load cell by {}", _all(180 / np.pi, "deg"),
        "correct imu_rotation_to_body or wrench_rotation_to_body",
    )  # fmt: skip
    CENTRE = "centre of gravity", "r_CG were off by {}", _all(-1e3, "mm"), "correct r_cg_from_q, or record static poses"
    MASS = "mass", "the mass were off by {}", _all(-1.0, "kg"), "weigh the body, or check the force's gain"
    STILL_MISSED = (
        "still missed", "the centre of gravity were off the point at rest by {}", _all(1e3, "mm"),
        "declare r_cg_from_omb with its uncertainty",
    )  # fmt: skip
    GYRO_SCALE = (
        "gyro scale",
        "the gyro's scale factors were wrong by {}",
        _all(-100.0, "%"),
        "calibrate it, or declare a scale",
    )
    GYRO_BIAS = (
        "gyro bias",
        "the gyro's zero changed by {}",
        _largest(1e3, "mrad/s²"),
        "let it warm up, or declare a drift",
    )
    GYRO_AXES = (
        "gyro axes", "the gyro were turned against the accelerometer by {}", _all(180 / np.pi, "deg"),
        "calibrate it, or declare a misalignment",
    )  # fmt: skip
    GYRO_G = (
        "gyro g-sensitivity", "acceleration feigned angular velocity, {}", _largest(1e3, "mrad/s per m/s²"),
        "use the gyro's calibration",
    )  # fmt: skip
    GAIN = "gain", "the load cell's gains were wrong by {}", _all(100.0, "%"), "calibrate it, or declare a scale"
    CROSS_TALK = (
        "cross-talk", "components of the load cell leaked into each other", _none,
        "use its calibration matrix, or declare the cross_talk",
    )  # fmt: skip
    DRIFT = "drift", "the load cell's zeros drifted", _none, "let it warm up, or declare a drift"
    JUMP = "jump", "the load cell's zeros jumped", _none, "record again"
    SLIP = "slip", "the body slipped by {}", _largest(1e3, "mm"), "clamp it, and record again"
    GAIN_DRIFT = "gain drift", "the load cell's gains changed by {} over the run", _all(100.0, "%"), "let it warm up"
    CABLE = "cable", "a cable pulled with up to {}", _pull, "lay it loosely, or carry it along"
    AIR = "air", "air or friction held the body back", _none, "turn more slowly"
    FLEXIBLE_MOUNTING = "flexible mounting", "{}", _stiffness, "stiffen it, or move more slowly"
    TENSOR = "tensor", "the tensor changed during the run: something moves", _none, "fix what moves"
    ACCELEROMETER_PLACE = (
        "accelerometer place",
        "the accelerometer stood elsewhere by {}",
        _all(1e3, "mm"),
        "correct imu_position",
    )
    ACCELEROMETER_SCALE = (
        "accelerometer scale",
        "the accelerometer's scale factors were wrong by {}",
        _all(-100.0, "%"),
        "calibrate it",
    )
    CLOCK = "clock", "the IMU's clock ran off by {} over the run", _all(1e3, "ms"), "check the stamps"
    FILTER = "filter", "{}", _lateness, "give both sensors the same filter, or declare the delay" + ESTIMATED
    NONLINEARITY = "nonlinearity", "the load cell were not linear", _none, "use its calibration, or load it less"
    RESONANCE = (
        "resonance", "the {quantity} on {axis} shakes at about {frequency} Hz, {size} rms", _none,
        "stiffen or damp what rings",
    )  # fmt: skip
    SPECTRAL_LINE = (
        "resonance", "a line at {frequency} Hz in the residual moment about {axis}, {size} rms", _none,
        "find what shakes at this frequency",
    )  # fmt: skip
    SATURATION = (
        "saturation", "the {quantity} on {axis} stays at {value} in {count} samples: the sensor's range ends there",
        _none, "move less",
    )  # fmt: skip
    LEAST_SQUARES = (
        "least squares", "ordinary least squares and the fit of force and moment together differ by {difference} g·m² "
        "in {component}, where {expected} is to be expected", _none,
        "usually r_CG is off, or a cable, cross-talk, a mounting that flexes",
    )  # fmt: skip
    UNEXPLAINED = (
        "unexplained", "the {quantity} on {axis} leaves {ratio:.1f} times what noise explains where the motion is: "
        "none of the causes looked for", _none, "the interval is that much wider",
    )  # fmt: skip
    REPEATABILITY = "repeatability", "the runs scatter otherwise than their residuals predict", _none, ""

    def __init__(self, label: str, pattern: str, size: Size, cure: str) -> None:
        """Name the parts of the member's value."""
        self.label, self.pattern, self.size, self.cure = label, pattern, size, cure

    def phrase(self, values: Float[np.ndarray, " p"], spread: Float[np.ndarray, " p"]) -> str:
        """Return what a run looks like by a cause's coefficients, in SI, with their standard uncertainties."""
        return f"as if {self.pattern.format(self.size(values, spread))} ({self.label})"

    def cause(self, run: str, *, axis: str, share: float, adds: str = "", **figures: object) -> ResidualCause:
        """Return the finding on a run, with the figures that its pattern names.

        Args:
            run: name of the run.
            axis: b1, b2 or b3; empty: none.
            share: part of the residuals' variance.
            adds: what it does to the tensor.
            figures: of the pattern, beside ``axis``.
        """
        text = f"{run}: {self.pattern.format(axis=axis, **figures)} ({self.label}); {self.cure}{adds}"
        return ResidualCause(cause=self.label, axis=axis, share=share, text=text, run=run)
