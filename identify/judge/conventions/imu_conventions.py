"""Units and axes of an IMU by itself: gravity must turn in the body as the gyro says, dg/dt = -ω × g.

Judged only where the accelerometer shows gravity and little else: not in free fall, where the specific force is that of
the IMU's lever from a centre that falls.
"""

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.axis_hypotheses import signed_axes
from identify.judge.conventions.carried_attitude import carried_by_gyro
from identify.judge.conventions.convention_fit import ImuSignal
from identify.rigid_body import regressor
from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.rigid_body.regressor import FIRST_MOMENT_OF_FEATURES
from identify.signals.filters import moving_average

LEAST_TURN = 0.5
"""Turn of gravity by the gyro from which its unit is judged [rad].

Choice: true, the accelerometer would show it.
"""
UNLIKE = 15.0
"""Ratio of gravity's turn by the gyro to that by the accelerometer from which the unit is wrong.

Choice: 57 in deg/s, two or three by a lever or a filter. In 40 clean runs at most 0.86
(``tests.helpers.judge_margins``).
"""
STEADY = 0.05
"""Variation of the specific force's magnitude, by median deviation, below which it is mostly gravity.

Choice: the motion's part is then a few degrees. In 40 clean runs at most 0.02 (``tests.helpers.judge_margins``).
"""
MOSTLY = 0.3
"""Variation that is allowed where acceleration only makes the accelerometer turn more.

Choice: the ratio of turns is then too small, which hides a wrong unit and feigns none.
"""
LEAST_TILT = 0.1
"""Turn of gravity below which axes are not judged [rad, rms].

Choice: with less, an IMU away from the axis of the motion may see gravity turn otherwise.
"""
WITHIN = 5.0
"""Seconds within which a turn counts.

Choice: slower ones may be a gyro's bias.
"""
GRAVITY_IN_G = (0.8, 1.25)
"""Least and largest median of the specific force that is gravity in g.

Choice: gravity with a body's acceleration; in m/s² it is ten.
"""
WITHOUT_GRAVITY = 0.13
"""Part of the specific force's power that a lever may leave over in free fall.

Measured: real throws leave less, runs under gravity more than 0.16, in wrong units, too. In 40 clean runs at least
0.96 (``tests.helpers.judge_margins``).
"""
LARGEST_LEVER = 1.0
"""Distance of a thrown IMU from the centre of gravity, as a standard deviation [m].

Prior: wider than a body that is thrown by hand.
"""
LARGEST_ZERO = 2.0
"""Zero of a thrown accelerometer, as a standard deviation [m/s²].

Prior: our choice, wide, so that it takes up an error of scale, too.
"""
FITS = 0.8
"""Correlation of gravity's turning with the gyro's from which another order of axes is named.

Choice: acceleration takes a fifth of it away.
"""
POORER = 0.5
"""Correlation as recorded over that of the best order of axes, below which the recorded order is refuted.

Choice: half, so that axes about which little turns are not judged.
"""
LEAST_GRAVITY_IN_ANY_UNIT = 0.5
"""Mean specific force along axes at rest, below which there is no gravity in it.

Choice: half of gravity in g, the least that it is in any unit. What is left is a change of velocity over ``SPAN``.
"""
SPAN = 5.0
"""Seconds over which the specific force is averaged along axes at rest.

Choice: a rig's velocity changes by some 2 m/s at most; a gyro's bias of 0.5 deg/s turns gravity by 2.5 deg.
"""
LEAST_SPAN = 2.0
"""Seconds of a run from which its gravity is judged.

Choice: a thrown body flies for one.
"""
LARGEST_ACCELERATION = 5.0
"""Median of the specific force from which there is gravity in it [m/s²].

Choice: half of gravity; a gyro in deg/s would turn gravity to nothing, and must not.
"""
FASTEST = 20.0
"""Angular velocity from which a gyro is taken for one in deg/s [rad/s].

Choice: no rig of this kind turns three times a second.
"""
FEW = 1e-3
"""Part of the acceleration's samples that are not zero, below which there is no accelerometer.

Choice: one in a thousand.
"""
SMOOTHED = 0.01
"""Window over which an IMU is averaged before its angular velocity is differentiated [s].

Choice: a throw lasts half a second.
"""


def wrong_units(imu: ImuSignal) -> dict[str, float]:
    """The units that seem to be used instead, with the figure that tells: median acceleration, ratio of the turns."""
    wrong = {}
    specific_force = float(np.nanmedian(np.linalg.norm(imu.specific_force, axis=1)))
    if in_free_fall(imu) or without_gravity(imu):
        return {}
    if GRAVITY_IN_G[0] < specific_force < GRAVITY_IN_G[1]:
        wrong["g"] = specific_force
    if _steady(imu, MOSTLY):
        by_gyro, by_accelerometer = _turns(imu)
        if by_gyro > LEAST_TURN and by_gyro > UNLIKE * by_accelerometer:
            wrong["deg/s"] = by_gyro / by_accelerometer if by_accelerometer > 0 else np.inf
    return wrong


def without_gravity(imu: ImuSignal) -> bool:
    """Whether an accelerometer's readings hold no gravity: their means along axes at rest, by the gyro, are nearly 0.

    Not judged: runs of less than ``LEAST_SPAN`` and those whose accelerometer is not used.
    """
    time, omega, specific = imu
    seconds = float(time[-1] - time[0]) if len(time) >= 100 else 0.0
    if not seconds >= LEAST_SPAN or np.mean(specific.any(axis=1)) < FEW or _steady(imu):
        return False
    if np.median(np.linalg.norm(specific, axis=1)) > LARGEST_ACCELERATION:
        return False
    if np.quantile(np.linalg.norm(omega, axis=1), 0.95) > FASTEST:
        omega = np.radians(omega)
    count = max(1, int(seconds / SPAN))
    means = [
        np.linalg.norm(np.einsum("nij,nj->i", carried_by_gyro(seconds / (len(time) - 1), w), f) / len(f))
        for w, f in zip(np.array_split(omega, count), np.array_split(specific, count), strict=True)
    ]
    return bool(np.median(means) < LEAST_GRAVITY_IN_ANY_UNIT)


def in_free_fall(imu: ImuSignal) -> bool:
    """Whether a lever explains the specific force without gravity."""
    time = imu.time
    return bool(len(time) >= 10 and time[-1] > time[0] and without_lever(imu) < WITHOUT_GRAVITY)


def without_lever(imu: ImuSignal) -> float:
    """Part of the specific force's power that a lever leaves over, ``f = α × r + ω × (ω × r) + zero``.

    By least squares with priors on lever and zero; what the priors cost counts, too.
    """
    time, omega, specific_force = imu
    step = float(time[-1] - time[0]) / (len(time) - 1)
    width = max(1, round(SMOOTHED / step))
    omega, force = (moving_average(signal, width, ends="fewer") for signal in (omega, specific_force))
    force, alpha = force[::width], np.gradient(omega, step, axis=0)[::width]
    motion = regressor.features(omega[::width].T, alpha.T)
    lever_columns = np.einsum("kn,kij->nij", motion, FIRST_MOMENT_OF_FEATURES)
    columns = np.concatenate([lever_columns, np.broadcast_to(np.eye(3), lever_columns.shape)], axis=2)
    power = max(float((force**2).sum()), 1e-12)
    priors = np.repeat([LARGEST_LEVER, LARGEST_ZERO], 3) ** -2.0
    normal = np.einsum("nij,nik->jk", columns, columns) / power + np.diag(priors)
    right = np.einsum("nij,ni->j", columns, force) / power
    return float(1 - right @ np.linalg.solve(normal, right))


def accelerometer_axes(imu: ImuSignal) -> Float[np.ndarray, "3 3"] | None:
    """The accelerometer's axes in which gravity turns as the gyro says; None: as recorded, or the motion is too small.

    A signed permutation, mirrored ones included.
    """
    if not _steady(imu) or in_free_fall(imu) or _turns(imu)[0] < LEAST_TILT:
        return None
    candidates = signed_axes()
    fits = [_correlation(imu, matrix) for matrix in candidates]
    best = int(np.argmax(fits))
    return candidates[best] if fits[best] > FITS and fits[0] < POORER * fits[best] else None


def _turned_gravity(time: np.ndarray, omega: np.ndarray, gravity: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """The change of gravity in the body frame since the first sample, as the gyro says."""
    rate = -np.cross(omega, gravity)
    steps = np.diff(time)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]) * steps, axis=0)])


def _turns(imu: ImuSignal) -> tuple[float, float]:
    """Return gravity's turn in the body within five seconds [rad, rms]: by the gyro; by the accelerometer."""
    time, omega, g = imu
    if len(time) < 100 or time[-1] <= time[0]:
        return 0.0, 0.0
    size = max(float(np.median(np.linalg.norm(g, axis=1))), 1e-9)
    width = min(len(time), max(1, round(WITHIN * len(time) / (time[-1] - time[0]))))
    by_gyro, by_accelerometer = (
        float(np.sqrt(((x - moving_average(x, width, ends="fewer")) ** 2).sum(axis=1).mean())) / size
        for x in (_turned_gravity(time, omega, g), g)
    )
    return by_gyro, by_accelerometer


def _steady(imu: ImuSignal, within: float = STEADY) -> bool:
    """Whether the accelerometer shows gravity and little else, unless in free fall: its turning is then the gyro's."""
    magnitude = np.linalg.norm(imu.specific_force, axis=1)
    middle = float(np.median(magnitude))
    return float(np.median(np.abs(magnitude - middle))) < within * middle and middle > GRAVITY_IN_G[0]


def _correlation(imu: ImuSignal, axes: np.ndarray) -> float:
    """Correlation of the turning of gravity with what the gyro says, the accelerometer's axes so rearranged."""
    gravity = imu.specific_force @ axes.T
    turned = _turned_gravity(imu.time, imu.angular_velocity, gravity)
    x, y = turned - turned.mean(axis=0), gravity - gravity.mean(axis=0)
    size = float(np.sqrt((x * x).sum() * (y * y).sum()))
    return float((x * y).sum()) / size if size > 1e-9 else 0.0


def in_si(imu: ImuSignal) -> ImuSignal:
    """Return the signal with what is probably in deg/s or g converted to SI."""
    wrong = wrong_units(imu)
    return imu._replace(
        angular_velocity=imu.angular_velocity * (np.pi / 180 if "deg/s" in wrong else 1.0),
        specific_force=imu.specific_force * (STANDARD_GRAVITY if "g" in wrong else 1.0),
    )
