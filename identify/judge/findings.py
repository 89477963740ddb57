"""All that the judge of a run may name: what the run looks as if, with its size, and the cure.

The members of :class:`Finding` are the messages, for terminal, ``result.json`` (``consistency``) and
docs/explanation/troubles.md alike. Members of one label are variants of one finding.
"""

from enum import Enum
from typing import NamedTuple

from identify.errors.error_model import PAGE
from identify.results.declaration import ResidualCause
from identify.rounding import significant

MATTERS = 0.5
"""Shift of a component over its standard uncertainty from which a finding is worth a warning.

Price: a standard uncertainty 12 % larger, ``hypot(1, 0.5)``.
"""


def signed(value: float) -> str:
    """Return a number of two digits with its sign."""
    return significant(value, 2, signed=True)


CHANNELS = "correct order and signs of its channels where they are recorded; no rotation in [recording] can"


class Contradiction(NamedTuple):
    """One suspicion against what is declared of a recording: what, on which topic, and what to do."""

    kind: str
    """Label of :class:`Finding`."""
    topic: str
    text: str


class _Words:
    """Label, pattern of the text and cure of what the judge may name."""

    def __init__(self, label: str, pattern: str, cure: str) -> None:
        """Name the parts of the member's value."""
        self.label, self.pattern, self.cure = label, pattern, cure

    @property
    def docs(self) -> str:
        """Page and anchor of the documentation on it."""
        return f"{PAGE}#{self.label.replace(' ', '-')}"

    def verdict(
        self, run: str, *, axis: str, share: float, text: str, changes: tuple[float, ...] = ()
    ) -> ResidualCause:
        """Return the finding on a run, in these words, with what it would add to the ten parameters."""
        return ResidualCause(
            cause=self.label, axis=axis, share=share, text=text, run=run, changes=changes, docs=self.docs
        )


class Finding(_Words, Enum):
    """A finding that is no error with a size: its label, the pattern of its text, and the cure."""

    ACCELEROMETER_DELAYED = (
        "accelerometer delay", "force and gyro fit only an accelerometer that lags behind them by {delay} ms",
        'set accelerometer_delay = "{delay} ms" in [recording], or give both the same filter'
    )  # fmt: skip
    CLOCKS_APART = (
        "clock", "by the log's times the stamps of the motion are {offset} s {early} against the wrench's{doubt}",
        'two computers? set time = "log" in [recording]{lines}'
    )  # fmt: skip
    RESONANCE = (
        "resonance", "the {quantity} on {axis} vibrates at about {frequency} Hz, {size} rms",
        "stiffen or damp what vibrates"
    )  # fmt: skip
    SPECTRAL_LINE = (
        "resonance", "a line at {frequency} Hz in the residual moment about {axis}, {size} rms",
        "find what vibrates at this frequency"
    )  # fmt: skip
    SATURATION = (
        "saturation", "the {quantity} on {axis} stays at {value} in {count} samples: the sensor's range ends there",
        "move less"
    )  # fmt: skip
    LEAST_SQUARES = (
        "least squares",
        "ordinary least squares and the fit of force and moment together differ by {difference} g·m² in {component}, "
        "where {expected} is expected", "usually a wrong r_CG, a cable, cross-talk or a flexible mounting"
    )  # fmt: skip
    UNEXPLAINED = (
        "unexplained",
        "the residual {quantity} on {axis} is {ratio:.1f} times what noise explains in the band of the motion: "
        "no known cause fits", "liquid or something loose inside? the interval is wider by as much"
    )  # fmt: skip
    IMPLAUSIBLE = (
        "unexplained",
        "the residuals follow the motion, most like {label}, but the runs do not agree on its size, or no rig errs by "
        "as much: no known cause fits", "the interval holds {component} {shift} g·m² off"
    )  # fmt: skip
    REPEATABILITY = "repeatability", "the runs scatter more than their residuals predict", ""
    ACCELERATION_IN_G = (
        "unit", "the median acceleration is {median:.3f}: it is probably in g, not m/s^2 (times 9.80665)",
        'set acceleration_unit = "g" in [recording]'
    )  # fmt: skip
    GYRO_IN_DEGREES = (
        "unit", "the gyro turns {ratio:.0f} times faster than gravity does: it is probably in deg/s",
        'set angular_velocity_unit = "deg/s" in [recording]'
    )  # fmt: skip
    RATE_UNIT = (
        "unit", "the attitude turns {ratio} times as fast as the angular velocity",
        'degrees taken for radians, or radians for degrees? set angular_velocity_unit = "{unit}" in [recording]'
    )  # fmt: skip
    UNITS = (
        "unit",
        "in the declared units no body of {shown} kg fits force and moment; in other units a body of {mass} kg does",
        "set {lines} in [recording]{doubt}"
    )  # fmt: skip
    UNITS_AT_REST = (
        "unit",
        "in the declared units the body has {shown} kg and its centre of gravity {at} from Q, which is {why}",
        "set {lines} in [recording]{decides}"
    )  # fmt: skip
    SIGN = (
        "sign", "force, moment and accelerometer or attitude contradict each other in sign: {words}; {by} {fit}{doubt}",
        "set {lines} in [recording]{decides}"
    )  # fmt: skip
    ACCELEROMETER_AXES = (
        "axes", "gravity turns with the gyro only if the accelerometer's axes are the gyro's ({axes})",
        "swapped axes"
    )  # fmt: skip
    OTHER_AXES = (
        "axes",
        "load cell and IMU have different axes: they fit each other only if the load cell's x, y, z "
        "are the IMU's ({axes}){doubt}", "set {lines} in [recording]"
    )  # fmt: skip
    RATE_AXES = (
        "turned", "the axes of angular velocity and attitude differ by a rotation of {angle} deg about ({about})",
        "two sensors? use one of them: import without the columns of the other, or record the attitude as poses"
    )  # fmt: skip
    EULER_RATES = (
        "euler rates",
        "the channels of the angular velocity hold the rates of Euler angles (turned axes {order}), not the angular "
        "velocity in the body's axes",
        "import the attitude in their place (columns.quaternion of a map){formula}"
    )  # fmt: skip
    IMU_MIRRORED = "mirror", "the IMU's axes are left-handed: only ({axes}) of them fit the wrench", CHANNELS
    IMU_MIRRORED_AND_TURNED = (
        "mirror",
        "the IMU's axes are left-handed, and only a rotation of its axes into the load cell's by {turn} fits both",
        CHANNELS
    )  # fmt: skip
    WRENCH_MIRRORED = (
        "mirror", "the load cell's axes are left-handed, or its sign is reversed and its axes turned{doubt}",
        'both are undone by wrench = "on_sensor" (the other one if it is already declared) and '
        "{lines} in [recording]"
    )  # fmt: skip
    TURNED = (
        "turned",
        "only a rotation of the IMU's axes into the load cell's by {turn} fits both{sign}{doubt}",
        "set {lines} in [recording]"
    )  # fmt: skip
    TURNED_A_LITTLE = (
        "turned", "only a rotation of the IMU's axes into the load cell's by {turn} fits both, or its stamps are late",
        "set {lines} in [recording], or correct the clock"
    )  # fmt: skip
    WRENCH_AT_REST = (
        "frame",
        "force and moment are along axes at rest: they fit weight and motion only if the attitude turns them into "
        "the body's axes{doubt}", "{lines}"
    )  # fmt: skip
    WRENCH_TURNS = (
        "frame", "force and moment are along axes that turn with the body, not along those at rest{doubt}",
        'set wrench_frame = "sensor" in [recording]'
    )  # fmt: skip
    ZERO_AT_REST = (
        "frame", "the zero of the force, about ({zero}) N, is constant along the axes at rest, not along the sensor's",
        'set zero_frame = "base" in [recording]'
    )  # fmt: skip
    GRAVITY_ELSEWHERE = (
        "gravity", "the weight points {angle} deg away from the declared gravity, seen from the axes at rest{doubt}",
        "base upside down, on a wall, or leaning? set urdf_gravity = [{gravity}] in [recording]"
    )  # fmt: skip
    WEIGHT_OF_ANOTHER_PAYLOAD = (
        "weight", "the force has the weight of {weighs} kg, but the inertia of {mass} kg{doubt}",
        'weight of {removed} kg removed by the driver? set compensated = "gravity", and payload_mass and '
        "payload_r_cg_from_q as set in the driver, in [recording]"
    )  # fmt: skip
    POSES_UPSIDE_DOWN = (
        "gravity",
        "the weight of the poses points up: the wrench has the other sign, or the force alone, which mirrors the "
        "centre of gravity, or gravity is upside down; forces at rest do not tell",
        'set wrench = "on_sensor" ("on_body" if that is already set), or the other sign in three rows of calibration, '
        "or urdf_gravity = [{gravity}], in [recording]"
    )  # fmt: skip
    ATTITUDE_READ_OTHERWISE = "attitude", "the forces fit the attitudes only {how}{doubt}", "{lines}"
    QUATERNION_ORDER = (
        "attitude", "the angular velocity fits the attitude only with the quaternion's fields read as ({order})",
        "{lines}"
    )  # fmt: skip
    WEIGHT_MISSING = "weight", "the force is the weight of {mass} kg, far less than that of {body}", "{lines}"
    WEIGHT_PARTLY_MISSING = (
        "weight", "the force changes like that of about {mass} kg, but {share:.0%} of its weight is missing throughout",
        "{lines}"
    )  # fmt: skip
    WEIGHT_OF_ANOTHER_MASS = (
        "mass", "the force is the weight of {weighs} kg, the declared mass is {stated} kg",
        "correct body.mass, force_unit or the load cell's calibration; or state what else the load cell carries in "
        "[fixture] and in body.mass; or the driver removed another payload's "
        "weight: state payload_mass and payload_r_cg_from_q"
    )  # fmt: skip
    CHANGED_MASS = (
        "mass", "the force is that of {before} kg up to {time} s of the run, and that of {after} kg afterwards",
        "body grasped or released during the run? identify the run with {option}"
    )  # fmt: skip
    OTHER_POINT = (
        "point", "force and moment put the centre of gravity {distance:.1f} mm from the declared one",
        "is the moment about another point than Q? set wrench_point = [{where}] in [recording]{unknown}, or correct "
        "body.r_cg_from_q{doubt}"
    )  # fmt: skip

    def cause(self, run: str, *, axis: str, share: float, adds: str = "", **figures: object) -> ResidualCause:
        """Return the finding on a run, with the figures that its pattern names.

        Args:
            run: name of the run.
            axis: b1, b2 or b3; empty: none.
            share: part of the residuals' variance.
            adds: what it does to the tensor.
            figures: of the pattern, beside ``axis``.
        """
        text = f"{run}: {self.pattern.format(axis=axis, **figures)} ({self.label}); {self.cure.format(**figures)}{adds}"
        return self.verdict(run, axis=axis, share=share, text=text)

    def on(self, topic: str, **figures: object) -> Contradiction:
        """Return the finding on what is declared of a recording, with the figures that pattern and cure name."""
        return Contradiction(self.label, topic, f"{self.pattern}: {self.cure}".format(**figures))
