"""The channels of the gyro hold the rates of Euler angles in place of the body's angular velocity.

## What it looks like

Of angles about turned axes, the channel of each axis holds the rate of its angle, or the channels hold the rates in
the order in which the axes are turned, such as yaw, pitch and roll.

## Why it matters

The body's angular velocity is another vector unless the angles are small. The tensor is wrong by as much as the two
differ.

## How it is decided

Where an attitude is recorded, the rates of its angles tell, by correlation. Otherwise the rates are integrated, the
vertical by the accelerometer, and force and moment tell: a body explains them only by the angular velocity that the
rates make. All orders of the axes are tried. Of angles of 0.15 rad or more.

## What to do

Import the attitude in place of the rates, by `columns.quaternion` of a map. Of yaw, pitch and roll the message has the
formula that makes the angular velocity of the rates.
"""

from itertools import permutations

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.axis_hypotheses import DECISIVE, chi_square, scales
from identify.judge.conventions.convention_fit import ImuSignal, WrenchSignal, convention_sums
from identify.judge.conventions.free_rotation import AS_IT_IS, well_explained
from identify.judge.findings import Finding
from identify.rigid_body.rotation import exponential, rotation_vectors

Rotations = Float[np.ndarray, "n 3 3"]

ORDERS = tuple("".join(order) for order in permutations("XYZ"))[::-1]
"""Orders of the turned axes, that of yaw, pitch and roll first."""
LAYOUTS = tuple((order, "XYZ") for order in ORDERS) + tuple((order, order) for order in ORDERS if order != "XYZ")
"""Orders of the turned axes, and the axes whose angles' rates the channels x, y, z hold."""
USUAL = "ZYX"
FORMULA = (
    ", or replace roll', pitch', yaw' by wx = roll' - yaw' sin(pitch), wy = pitch' cos(roll) + yaw' cos(pitch) "
    "sin(roll), wz = yaw' cos(pitch) cos(roll) - pitch' sin(roll)"
)
"""Cure where the angles are yaw, pitch and roll."""
EXPLAINED = 0.02
"""Part of the changes below which the channels are the angular velocity.

Choice: twice what a good fit leaves.
"""
FEW = 300
"""Instants at which gravity places the angles.

Numerical: six numbers from 900.
"""
STEPS = 8
"""Steps of Gauss–Newton to the angles at the start.

Numerical: from angles of zero it takes five.
"""
DIFFERENCE = 1e-5
"""Numerical: change of an angle for a derivative [rad]."""
ANGLES_FIT = 0.98
"""Correlation of the channels with the rates of a recorded attitude's angles from which they are these.

Choice: what filters and delays leave over is less.
"""
BETTER = 0.02
"""Correlation by which the rates must be better than the angular velocity.

Choice: small angles, where both are alike, are not judged.
"""


class RatesOfAngles(Finding):
    """Channels that hold the rates of Euler angles."""

    order: str
    """Axes in the order in which they are turned, such as ZYX."""
    channels: str
    """Axes whose angles' rates the channels x, y, z hold."""

    @property
    def looks(self) -> str:
        held = "" if self.channels == "XYZ" else f", x, y, z in the order {self.channels}"
        return (
            f"the channels of the angular velocity hold the rates of Euler angles (turned axes {self.order}{held}), "
            "not the angular velocity in the body's axes"
        )

    @property
    def cure(self) -> str:
        formula = FORMULA * (self.order == USUAL)
        return f"import the attitude in their place (columns.quaternion of a map){formula}"


EXAMPLES = (RatesOfAngles(topic="/imu", order="ZYX", channels="XYZ"),)


def euler_rates_finding(wrench: WrenchSignal, imu: ImuSignal, topic: str) -> list[Finding]:
    """Return the finding where a body explains force and moment only by the angular velocity that the rates make.

    Args:
        wrench: in B and SI.
        imu: the same.
        topic: of the IMU.
    """
    sums = convention_sums(wrench, imu)
    if sums is None or well_explained(sums, EXPLAINED):
        return []
    best = None
    for order, channels in LAYOUTS:
        by_axis = imu._replace(angular_velocity=_by_axis(imu.angular_velocity, channels))
        made = convention_sums(wrench, imu._replace(angular_velocity=angular_velocity(by_axis, order)))
        if made is None or not well_explained(made):
            continue
        given = scales(made, weight=False, candidates=(AS_IT_IS,))
        gain = float(chi_square(sums, given) - chi_square(made, given))
        if gain > max(DECISIVE, best[0] if best else 0.0):
            best = gain, order, channels
    return [] if best is None else [RatesOfAngles(topic=topic, order=best[1], channels=best[2])]


def rates_of_attitude(imu: ImuSignal, to_rest: Float[np.ndarray, "n 3 3"], topic: str) -> list[Finding]:
    """Return the finding where the channels are the rates of a recorded attitude's angles.

    Args:
        imu: its angular velocity, along the axes of the sensor.
        to_rest: rotations from these axes to axes at rest, at its instants.
        topic: of the IMU.
    """
    between = np.diff(imu.time)[:, None]
    middle = 0.5 * (imu.angular_velocity[1:] + imu.angular_velocity[:-1])
    as_read = _correlation(_turns(to_rest) / between, middle)
    rates = {order: np.diff(_angles(to_rest, order), axis=0) / between for order in ORDERS}
    fits = {layout: _correlation(rates[layout[0]], _by_axis(middle, layout[1])) for layout in LAYOUTS}
    order, channels = layout = max(LAYOUTS, key=fits.__getitem__)
    is_rates = fits[layout] > max(ANGLES_FIT, as_read + BETTER)
    return [RatesOfAngles(topic=topic, order=order, channels=channels)] if is_rates else []


def _by_axis(channels: Float[np.ndarray, "n 3"], axes: str) -> Float[np.ndarray, "n 3"]:
    """Return channels that belong to these axes, each in the column of its axis."""
    return channels[:, [axes.index(axis) for axis in "XYZ"]]


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    return float((x * y).sum() / max(np.sqrt((x * x).sum() * (y * y).sum()), 1e-12))


def _axes(order: str) -> list[int]:
    """The turned axes of an order."""
    return ["XYZ".index(axis) for axis in order]


def _angles(attitude: Rotations, order: str) -> Float[np.ndarray, "n 3"]:
    """The angles of an attitude, each in the channel of its axis [rad]."""
    i, j, k = _axes(order)
    sign = 1.0 if (i + 1) % 3 == j else -1.0
    angles = np.empty((len(attitude), 3))
    angles[:, i] = np.arctan2(-sign * attitude[:, j, k], attitude[:, k, k])
    angles[:, j] = np.arcsin(np.clip(sign * attitude[:, i, k], -1.0, 1.0))
    angles[:, k] = np.arctan2(-sign * attitude[:, i, j], attitude[:, i, i])
    return np.unwrap(angles, axis=0)


def _attitude(angles: np.ndarray, order: str) -> Rotations:
    """The attitude of angles, each in the channel of its axis [rad]."""
    first, second, third = (exponential(angles[:, [axis]] * np.eye(3)[axis]) for axis in _axes(order))
    return np.asarray(first @ second @ third)


def _turns(attitude: Rotations) -> Float[np.ndarray, "m 3"]:
    """Rotation vectors from each attitude to the next, in the axes that turn."""
    return rotation_vectors(attitude[:-1].swapaxes(1, 2) @ attitude[1:])


def angular_velocity(imu: ImuSignal, order: str) -> Float[np.ndarray, "n 3"]:
    """Return the body's angular velocity, were the channels the rates of Euler angles of an order [rad/s].

    The angles' constants and the channels' zeros are those with which the vertical at rest is nearest to the specific
    force.
    """
    time, rates, specific = imu
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(time)[:, None]
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    progress = ((time - time[0]) / (time[-1] - time[0]))[:, None]
    few = slice(None, None, max(1, len(time) // FEW))
    up = specific[few] / np.maximum(np.linalg.norm(specific[few], axis=1, keepdims=True), 1e-12)

    def angles(x: np.ndarray, part: slice) -> np.ndarray:
        return turned[part] + x[:3] + progress[part] * x[3:]

    def misfit(x: np.ndarray) -> np.ndarray:
        vertical = _attitude(angles(x, few), order)[:, 2]
        return np.asarray((vertical - up).ravel())

    x = np.zeros(6)
    for _ in range(STEPS):
        here = misfit(x)
        slopes = np.stack([(misfit(x + DIFFERENCE * unit) - here) / DIFFERENCE for unit in np.eye(6)], axis=1)
        x = x - np.linalg.lstsq(slopes, here, rcond=1e-3)[0]
    between = _turns(_attitude(angles(x, slice(None)), order)) / np.diff(time)[:, None]
    middles = 0.5 * (time[1:] + time[:-1])
    return np.stack([np.interp(time, middles, column) for column in between.T], axis=1)
