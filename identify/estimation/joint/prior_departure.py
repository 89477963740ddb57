"""Unknowns that the runs place far from what was declared of them: the first thing a reader should know."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from identify.errors.error_model import ErrorModel
from identify.estimation.joint.joint_model import BY_ACT, SIZES, SLICES
from identify.estimation.joint.priors import Prior
from identify.results.declaration import Declaration

FAR = 4.0
"""Standard uncertainties of the prior from which a departure is told.

Chance: with 20 normal numbers, one clean run of 790 has one; from 3 on, one run of 19 would.
"""


class Quantity(NamedTuple):
    """Name, unit and cure of an unknown in texts."""

    words: str
    scale: float
    unit: str
    advice: str


def _by_act(error: ErrorModel) -> Quantity:
    """The texts of an error that is an unknown by its file alone; without a typical size in SI."""
    size, advice = error.typical, "declare it wider, or calibrate"
    if size is None:
        return Quantity(error.name.replace("_", " "), 1.0, "(SI)", advice)
    return Quantity(size.text, size.per_si, size.unit, advice)


QUANTITIES = {
    "rotation": Quantity("rotation vector of the IMU", 180 / np.pi, "°", "check the frames of load cell and IMU"),
    "mass": Quantity(
        "mass", 1.0, "kg",
        "check the load cell's gain, platform.gravity, the accelerometer's place (imu_position), and what else the "
        "load cell carries ([fixture])",
    ),
    "r_cg": Quantity("centre of gravity", 1e3, "mm", "check r_cg_from_q, and the load cell's zero and gain"),
    "force_offset": Quantity("zero of the force", 1.0, "N", "check that the load cell was not tared between runs"),
    "moment_offset": Quantity("zero of the moment", 1.0, "N·m", "check that the load cell was not tared between runs"),
    "gyro_bias": Quantity(
        "zero of the gyro", 1e3, "mrad/s",
        "check its unit, declare sigma_gyro_bias wider, or accelerometer_delay if the accelerometer lags behind it",
    ),
    "delay": Quantity(
        "delay", 1e3, "ms",
        "check the clocks, declare the delay, or accelerometer_delay if the accelerometer lags behind the gyro",
    ),
    "accelerometer_bias": Quantity(
        "zero of the accelerometer", 1.0, "m/s²", "check its place (imu_position), its scale and its axes"
    ),
    "cg_from_still": Quantity(
        "distance of the centre of gravity from the point at rest", 1e3, "mm",
        'the centre of gravity is not still: declare r_cg_from_omb with its uncertainty, or remove cg_motion = "still"',
    ),
    "gravity": Quantity("error of gravity", 1.0, "m/s²", "check platform.gravity and the load cell's gain"),
    "gyro_scale": Quantity("scale error of the gyro", 100.0, "%", "declare it wider, or calibrate"),
    "cell_matrix": Quantity("error of the load cell's matrix", 100.0, "%", "declare it wider, or calibrate"),
    **{name: _by_act(error) for name, error in BY_ACT.items()},
}  # fmt: skip
"""Name, unit and cure of each unknown of the joint model, the rotation first, as all others are in its axes.

Unknowns that are missing here only absorb slow errors."""


def departures(theta: np.ndarray, prior: Prior, names: Collection[str] = QUANTITIES) -> tuple[Declaration, ...]:
    """Return the unknowns that are far from their priors, each by its worst component.

    Args:
        theta: the estimate of all unknowns, in their order.
        prior: of the unknowns.
        names: of the unknowns that are looked at.
    """
    sigma = np.sqrt(np.diag(prior.covariance))  # zero for what is exact or has no prior
    distance = np.abs(theta - prior.mean) / np.where(sigma > 0, sigma, np.inf)
    far = []
    for name in QUANTITIES:
        here = SLICES[name]
        worst = here.start + int(np.argmax(distance[here]))
        if name in names and distance[worst] > FAR:
            far.append(declaration(name, worst - here.start, theta[worst], prior.mean[worst], sigma[worst]))
    return tuple(far)


def declaration(
    name: str, component: int, value: float, declared: float, sigma: float, *, exact: bool = False
) -> Declaration:
    """Return the record of one component of an unknown.

    Args:
        name: of the unknown.
        component: of its numbers.
        value: estimate of it.
        declared: mean of its prior.
        sigma: standard uncertainty of its prior, or a typical one.
        exact: whether none was declared.
    """
    axis = component + 1 if SIZES[name] == 3 else None
    return Declaration(
        quantity=name, axis=axis, value=float(value), declared=float(declared), standard_uncertainty=float(sigma),
        exact=exact, **QUANTITIES[name]._asdict(),
    )  # fmt: skip
