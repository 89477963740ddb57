"""All that the judge of a run may name: what the run looks as if, with its size, and the cure.

The members of :class:`Finding` are the messages, for terminal, ``result.json`` (``consistency``) and
docs/explanation/troubles.md alike. Members of one label are variants of one finding.
"""

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.results.residual_cause import ResidualCause
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


PAGE = "docs/explanation/troubles.md"
"""Page of the documentation with a row for each finding."""
CHANNELS = "correct order and signs of its channels where they are recorded; no rotation in [recording] can"


class Contradiction(NamedTuple):
    """One suspicion against what is declared of a recording: what, on which topic, and what to do."""

    kind: str
    """Label of :class:`Finding`."""
    topic: str
    text: str


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
    CLOCKS_APART = (
        "clock", "by the log's times the stamps of the motion are {offset} s {early} against the wrench's{doubt}",
        _none,
        'two computers? set time = "log" in [recording]{lines}',
    )  # fmt: skip
    CLOCK = "clock", "the IMU's clock ran off by {} over the run", _first(1e3, "ms"), "check the stamps"
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

    ACCELERATION_IN_G = (
        "unit", "acceleration is {median:.3f} in the median: it is probably in g, not m/s^2 (times 9.80665)", _none,
        'set acceleration_unit = "g" in [recording]',
    )  # fmt: skip
    GYRO_IN_DEGREES = (
        "unit", "the gyro turns {ratio:.0f} times faster than gravity does: it is probably in deg/s", _none,
        'set angular_velocity_unit = "deg/s" in [recording]',
    )  # fmt: skip
    UNITS = (
        "unit", "force and moment are those of no body of {shown} kg as declared, but of one of {mass} kg in other "
        "units", _none, "set {lines} in [recording]{doubt}",
    )  # fmt: skip
    WRENCH_REVERSED = (
        "sign", "force and moment have the reversed sign: gravity and the motion fit only the wrench on the sensor"
        "{doubt}", _none, 'set wrench = "on_sensor" in [recording] ("on_body" where it says so already)',
    )  # fmt: skip
    ACCELEROMETER_AXES = (
        "axes", "gravity turns as the gyro says only if the accelerometer's axes are the gyro's ({axes})", _none,
        "swapped axes",
    )  # fmt: skip
    OTHER_AXES = (
        "axes", "load cell and IMU have different axes: gravity and the motion fit in both only if the load cell's "
        "x, y, z are the IMU's ({axes}){doubt}", _none, "set {lines} in [recording]",
    )  # fmt: skip
    IMU_MIRRORED = (
        "mirror", "the IMU's axes are left-handed: only ({axes}) of them fit the wrench", _none, CHANNELS,
    )  # fmt: skip
    IMU_MIRRORED_AND_TURNED = (
        "mirror", "the IMU's axes are left-handed, and only a turn of the IMU's axes into the load cell's by {turn} "
        "fits gravity and the motion in both", _none, CHANNELS,
    )  # fmt: skip
    WRENCH_MIRRORED = (
        "mirror", "the load cell's axes are left-handed, or its sign is reversed and its axes turned", _none,
        'both are undone by wrench = "on_sensor" (the other one where it is declared) and wrench_rotation_to_body = '
        "{axes} in [recording]",
    )  # fmt: skip
    TURNED = (
        "turned", "only a turn of the IMU's axes into the load cell's by {turn} fits gravity and the motion in both"
        "{sign}", _none, "set {lines} in [recording]",
    )  # fmt: skip
    TURNED_A_LITTLE = (
        "turned", "only a turn of the IMU's axes into the load cell's by {turn} fits both, or its stamps are late",
        _none, "set {lines} in [recording], or correct the clock",
    )  # fmt: skip
    ACCELEROMETER_REVERSED = (
        "sign", "the accelerometer reads downwards at rest: gravity and the motion fit the wrench only with its other "
        "sign{doubt}", _none, 'set accelerometer_at_rest = "down" in [recording] ("up" where it says so already)',
    )  # fmt: skip
    WRENCH_AT_REST = (
        "frame", "force and moment are along axes at rest: they fit weight and motion only when the attitude turns "
        "them into the body's axes{doubt}", _none, "{lines}",
    )  # fmt: skip
    WRENCH_TURNS = (
        "frame", "force and moment are along axes that turn with the body, not along those at rest{doubt}", _none,
        'set wrench_frame = "sensor" in [recording]',
    )  # fmt: skip
    ZERO_AT_REST = (
        "frame", "the zero of the force, about ({zero}) N, is constant along the axes at rest, not along the sensor's",
        _none, 'set zero_frame = "base" in [recording]',
    )  # fmt: skip
    GRAVITY_ELSEWHERE = (
        "gravity", "the weight points {angle} deg away from the declared gravity, seen from the axes at rest{doubt}",
        _none, "base upside down, on a wall, or leaning? set urdf_gravity = [{gravity}] in [recording]",
    )  # fmt: skip
    WEIGHT_OF_ANOTHER_PAYLOAD = (
        "weight", "the force has the weight of {weighs} kg, but the inertia of {mass} kg{doubt}", _none,
        'weight of {removed} kg removed by the driver? set compensated = "gravity" in [recording], with payload_mass '
        "and payload_r_cg_from_q where that payload is not the body",
    )  # fmt: skip
    POSES_UPSIDE_DOWN = (
        "gravity", "the weight of the poses points up: the wrench has the other sign, or gravity is upside down, which "
        "forces at rest do not tell apart", _none,
        'set wrench = "on_sensor" ("on_body" where it says so already), or urdf_gravity = [{gravity}], in [recording]',
    )  # fmt: skip
    ATTITUDE_READ_OTHERWISE = (
        "attitude", "the forces fit the attitudes only {how}{doubt}", _none, "{lines}",
    )  # fmt: skip
    WEIGHT_MISSING = "weight", "the force is the weight of {mass} kg, far less than that of {body}", _none, "{lines}"
    WEIGHT_PARTLY_MISSING = (
        "weight", "the force changes as that of some {mass} kg, but {share:.0%} of its weight is missing throughout",
        _none, "{lines}",
    )  # fmt: skip
    WEIGHT_OF_ANOTHER_MASS = (
        "mass", "the force is the weight of {weighs} kg, the declared mass is {stated} kg", _none,
        "correct body.mass, force_unit or the load cell's calibration; or the driver removed another payload's weight: "
        "state payload_mass and payload_r_cg_from_q",
    )  # fmt: skip
    CHANGED_MASS = (
        "mass", "the force is that of {before} kg up to {time} s of the run, and of {after} kg from there on", _none,
        "body grasped or put down midway? identify the run with {option}",
    )  # fmt: skip
    OTHER_POINT = (
        "point", "force and moment put the centre of gravity {distance:.1f} mm from the declared one", _none,
        "moment taken at another point than Q? set wrench_point = [{where}] in [recording]{unknown}, or correct "
        "body.r_cg_from_q",
    )  # fmt: skip

    def __init__(self, label: str, pattern: str, size: Size, cure: str) -> None:
        """Name the parts of the member's value."""
        self.label, self.pattern, self.size, self.cure = label, pattern, size, cure

    def phrase(self, values: Float[np.ndarray, " p"], spread: Float[np.ndarray, " p"]) -> str:
        """Return what a run looks like by a cause's coefficients, in SI, with their standard uncertainties."""
        return f"as if {self.pattern.format(self.size(values, spread))} ({self.label})"

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return f"{PAGE}#{self.label.replace(' ', '-')}"

    def verdict(self, run: str, *, axis: str, share: float, text: str) -> ResidualCause:
        """Return the finding on a run, in these words."""
        return ResidualCause(cause=self.label, axis=axis, share=share, text=text, run=run, docs=self.docs)

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
        return self.verdict(run, axis=axis, share=share, text=text)

    def on(self, topic: str, **figures: object) -> Contradiction:
        """Return the finding on what is declared of a recording, with the figures that pattern and cure name."""
        return Contradiction(self.label, topic, f"{self.pattern}: {self.cure}".format(**figures))
