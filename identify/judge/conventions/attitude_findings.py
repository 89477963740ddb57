"""Findings on an attitude and an angular velocity that contradict each other: order, direction, unit, axes.

Over a step, the attitude turns by the mean angular velocity, s Q omega: the scale s is that of a unit, the rotation Q
that of two sensors with other axes. Each way to read a quaternion's fields is one such fit (Kabsch, 1976).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.convention_fit import DeclaredRig, ImuSignal, Vector
from identify.judge.conventions.findings.attitude import QuaternionFields
from identify.judge.conventions.findings.euler_rates import rates_of_attitude
from identify.judge.conventions.findings.turned import RateAxes
from identify.judge.conventions.findings.unit import RateUnit
from identify.judge.cure import Entries
from identify.judge.findings import Finding
from identify.rigid_body.rotation import closest_rotation, from_quaternions, quaternions, rotation_vectors, signed_order

ORDERS = ("x, y, z, w", "-x, -y, -z, w", "w, x, y, z", "w, -x, -y, -z")
"""Meanings of a quaternion's fields x, y, z, w: as they are named, the other way, and with the scalar first."""
STEP = 0.1
"""Time over which the attitude's turn is compared [s].

Choice: the noise of an attitude is small against it, and an arm turns by less than a radian.
"""
FITS = 0.9
"""Correlation from which angular velocity and attitude tell the same motion.

Choice: what filters and delays leave over is less.
"""
BETTER = 0.1
"""Correlation by which another reading of the quaternion must be better.

Choice: twice what noise and delay take away.
"""
LEAST_SCALE = 1.3
"""Factor between the two from which the unit is another.

Choice: no gyro's scale is so wrong.
"""
LEAST_ANGLE = np.radians(5.0)
"""Turn between the axes of the two that is named.

Choice: within it, the filter of an attitude and a mounting by eye.
"""
RATES = {"deg/s": np.pi / 180, "rad^2/deg/s": 180 / np.pi, "rpm": np.pi / 30, "rad/s": 1.0, "mrad/s": 1e-3}
"""Units of an angular velocity in SI; that in rad²/deg was turned from degrees to radians once too often."""

Rotations = Float[np.ndarray, "n 3 3"]


class _Agreement(NamedTuple):
    """The fit of an angular velocity to what an attitude turns by."""

    correlation: float
    scale: float
    turn: Vector
    """Rotation vector from the axes of the angular velocity to those of the attitude [rad]."""

    @property
    def angle(self) -> float:
        """Angle between the axes [rad]."""
        return float(np.linalg.norm(self.turn))


def read_as(to_rest: Rotations, order: str, declared: DeclaredRig) -> Rotations:
    """Return rotations from B to axes at rest with the quaternion's fields read in another order.

    Args:
        to_rest: as they are read.
        order: one of ``ORDERS``.
        declared: the sensor's axes in B.
    """
    to_body = declared.imu_rotation
    scalar_last = np.roll(quaternions(to_rest @ to_body), -1, axis=1) @ signed_order(order, "xyzw")
    return np.asarray(from_quaternions(np.roll(scalar_last, 1, axis=1)) @ to_body.T)


def order_entry(order: str, declared: DeclaredRig) -> Entries:
    """Return the key that declares an order of the quaternion's fields."""
    return Entries({"quaternion": declared.quaternion @ signed_order(order, "xyzw")})


def attitude_findings(imu: ImuSignal, to_rest: Rotations, declared: DeclaredRig, topic: str) -> list[Finding]:
    """Return the findings on attitude and angular velocity of a sensor; none where they tell the same, or nothing.

    Args:
        imu: its angular velocity.
        to_rest: rotations from B to axes at rest, at its instants.
        declared: of the recording.
        topic: what messages call it.
    """
    fits = {order: _agreement(imu, read_as(to_rest, order, declared)) for order in ORDERS}
    # The scalar in another place is the other direction with other axes on both sides, so that the turn decides.
    most = max(fit.correlation for fit in fits.values())
    alike = [name for name in ORDERS if fits[name].correlation > most - BETTER / 2]
    order = min(alike, key=lambda name: fits[name].angle)
    best, as_read = fits[order], fits[ORDERS[0]]
    to_body = declared.imu_rotation
    along_sensor = imu._replace(angular_velocity=imu.angular_velocity @ to_body)
    if rates := rates_of_attitude(along_sensor, to_rest @ to_body, topic):
        return rates
    if best.correlation < FITS:
        return []
    findings: list[Finding] = []
    if best.correlation > as_read.correlation + BETTER:
        findings.append(QuaternionFields(topic=topic, order=order, settings=order_entry(order, declared)))
    else:
        best = as_read
    if abs(np.log(best.scale)) > np.log(LEAST_SCALE):
        unit = min(RATES, key=lambda name: abs(np.log(best.scale * declared.rate_unit / RATES[name])))
        findings.append(RateUnit(topic=topic, ratio=best.scale, unit=unit))
    if best.angle > LEAST_ANGLE:
        findings.append(RateAxes(topic=topic, vector=best.turn))
    return findings


def _agreement(imu: ImuSignal, to_rest: Rotations) -> _Agreement:
    step = float(np.median(np.diff(imu.time)))
    count = max(1, round(STEP / step)) if step > 0 else len(imu.time)
    if len(imu.time) < 10 * count:
        return _Agreement(0.0, 1.0, np.zeros(3))
    turned = rotation_vectors(to_rest[:-count].swapaxes(1, 2) @ to_rest[count:])
    total = np.cumsum(0.5 * (imu.angular_velocity[1:] + imu.angular_velocity[:-1]) * np.diff(imu.time)[:, None], axis=0)
    total = np.concatenate([np.zeros((1, 3)), total])
    integral = total[count:] - total[:-count]
    turned, integral = turned - turned.mean(axis=0), integral - integral.mean(axis=0)
    rotation = closest_rotation(turned.T @ integral)
    product, power = float((turned * (integral @ rotation.T)).sum()), float((integral**2).sum())
    size = np.sqrt(power * float((turned**2).sum()))
    if not size > 0:
        return _Agreement(0.0, 1.0, np.zeros(3))
    return _Agreement(product / size, max(product / power, 1e-12), rotation_vectors(rotation[None])[0])
