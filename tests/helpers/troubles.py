"""Named troubles of tests/helpers/laboratory.py, each of a size, and the size at which one shifts plain least squares by so much.

``measure(3, **TROUBLES["cable"].options(0.5, 3))`` is run 3 with a cable of half the usual stiffness.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.signal import savgol_filter

from tests.helpers.laboratory import FULL_SCALE, NOISE, RATE, SIGMA, Measured, Setup, measure
from tests.helpers.laboratory_mechanics import FINE, GRAVITY, LEVER, base_motion, carried, cross


@dataclass(frozen=True)
class Trouble:
    """What goes wrong, as options of :class:`tests.helpers.laboratory.Setup`."""

    unit: str
    typical: float
    """A size that a laboratory may have; the first that is tried."""
    most: float
    """The largest that is tried."""
    of: Callable[[float, np.random.Generator], dict]
    causes: tuple[str, ...] = ()
    """Names of the diagnosis that are right; none: it is no named cause."""
    still: bool | None = None
    """The motion that it needs; None: either."""
    sizes: tuple[float, float] | None = None
    """Small and large, where they are not from what they shift."""
    sources: Callable[[float], list] = lambda size: []
    """Sources of an experiment that declare it, drawn with this size: arguments of ``laboratory_files.source``."""

    def options(self, size, seed):
        """Options for a size; where it has a direction, that is drawn by the seed alone."""
        return self.of(size, np.random.default_rng([20162, seed]))


def vector(field, count=3, scale=1.0):
    """A trouble with as many components, drawn normal with the size for root sum of squares."""
    return lambda size, rng: {field: tuple(size * np.multiply(scale, rng.standard_normal(count) / np.sqrt(count)))}


def same(field, count=3, scale=1.0):
    """A trouble of one size on all components."""
    return lambda size, rng: {field: tuple(size * np.multiply(scale, np.ones(count)))}


def scalar(field, scale=1.0):
    return lambda size, rng: {field: scale * size}


def axes(name, target, kind, count=3):
    """Its declaration, where all components were drawn alike."""
    factor = 100 if kind == "scale" else 1  # per cent
    return lambda size: [(name, target, kind, [factor * size / np.sqrt(count)] * 3)]


def _talk(size, rng):
    matrix = size * rng.standard_normal((6, 6)) * (1 - np.eye(6))
    return {"cross_talk": matrix * FULL_SCALE[:, None] / FULL_SCALE}


def _flexible(size, rng):
    return {"flex_frequency": 25 / np.sqrt(size)} if size > 0 else {}


def _common_gain(first):
    """A gain that three axes have in common, as the bridge's excitation voltage gives."""
    axes_with = np.isin(np.arange(6), np.arange(first, first + 3))
    return lambda size, rng: {"cell_gain": tuple(size * rng.choice([-1, 1]) * axes_with)}


CELL = np.array([1, 1, 1, 0.03, 0.03, 0.03])
"""A newton, and the moment that goes with it."""
TROUBLES = {
    "still missed": Trouble(
        "m", 1e-3, 0.05, vector("still_miss"), ("still missed",), still=True,
        sources=axes("still", "r_cg_from_omb", "bias"),
    ),
    "still on a lever": Trouble(
        "m", 0.11, 0.11, lambda size, rng: {"still_miss": tuple(size * LEVER / np.linalg.norm(LEVER))},
        ("still missed",), still=True, sizes=(0.03, 0.11),
    ),
    "tilt": Trouble("rad", 0.01, 0.1, vector("tilt"), sources=axes("tilt", "tilt", "bias")),
    "vibration": Trouble("m/s²", 1.0, 5.0, same("vibration")),
    "shaking": Trouble("rad/s²", 5.0, 100.0, same("shaking")),
    "flexible mounting": Trouble("(25 Hz/f0)²", 1.0, 6.0, _flexible, ("flexible mounting",)),
    "ringing mounting": Trouble(
        "(25 Hz/f0)², 1.7 N·m", 1.0, 6.0, lambda size, rng: _flexible(size, rng) | {"ringing": 1.7 * size},
        ("flexible mounting", "resonance"),
    ),
    "cable": Trouble(
        "0.1 N·m/rad, 2 N/rad", 1.0, 100.0,
        lambda size, rng: {"cable_moment": 0.1 * size, "cable_force": 2 * size}, ("cable", "attitude"),
    ),
    "air": Trouble(
        "N·m·s/rad", 0.005, 0.5, lambda size, rng: {"drag": (size,) * 3, "drag_squared": (size,) * 3}, ("air",)
    ),
    "sloshing": Trouble("kg", 0.05, 2.0, scalar("slosh_mass")),
    "slip": Trouble("m", 1e-3, 0.02, vector("slip"), ("slip",)),
    "mass": Trouble("kg", 0.05, 2.0, lambda size, rng: {"mass_error": size * rng.choice([-1, 1])}, ("mass",)),
    "r_CG": Trouble(
        "m", 1e-3, 0.05, vector("r_cg_error"), ("centre of gravity",), sources=axes("r_cg", "r_cg", "bias")
    ),
    "gyro scale": Trouble(
        "1", 3e-3, 0.1, vector("gyro_scale"), ("gyro scale",), sources=axes("gyro_scale", "omega", "scale")
    ),
    "gyro axes": Trouble(
        "rad", 0.01, 0.3, vector("gyro_turn"), ("gyro axes", "rotation"), sources=axes("gyro_axes", "omega", "misalignment")
    ),
    "IMU axes": Trouble(
        "rad", 0.01, 0.3, vector("imu_turn"), ("rotation",), sources=axes("gyro_axes", "omega", "misalignment")
    ),
    "gyro g-sensitivity": Trouble(
        "rad/s per m/s²", 1e-4, 0.02, lambda size, rng: {"gyro_g": size * rng.standard_normal((3, 3)) / 3}
    ),
    "gyro drift": Trouble(
        "rad/s over 30 s", 0.01, 0.5, vector("gyro_drift"), ("gyro bias",),
        sources=lambda size: axes("gyro_drift", "omega", "drift")(size / 30),
    ),
    "accelerometer scale": Trouble("1", 5e-3, 0.1, vector("accelerometer_scale")),
    "accelerometer offset": Trouble("m/s²", 0.1, 2.0, vector("accelerometer_offset")),
    "accelerometer place": Trouble("m", 2e-3, 0.1, vector("imu_position_error")),
    "gain of force": Trouble(
        "1", 5e-3, 0.2, lambda size, rng: {"cell_gain": (*(size * rng.standard_normal(3) / np.sqrt(3)), 0.0, 0.0, 0.0)},
        ("gain",), sources=axes("F_gain", "F", "scale"),
    ),
    "gain of moment": Trouble(
        "1", 5e-3, 0.2, lambda size, rng: {"cell_gain": (0.0, 0.0, 0.0, *(size * rng.standard_normal(3) / np.sqrt(3)))},
        ("gain",), sources=axes("M_gain", "M", "scale"),
    ),
    "common gain of force": Trouble("1", 5e-3, 0.2, _common_gain(0), ("gain", "mass")),
    "common gain of moment": Trouble("1", 5e-3, 0.2, _common_gain(3), ("gain", "centre of gravity")),
    "cross-talk": Trouble(
        "of full scale", 5e-3, 0.2, _talk, ("cross-talk",),
        sources=lambda size: [("cross_talk", "wrench", "cross_talk", size)],
    ),
    "load cell axes": Trouble(
        "rad", 0.01, 1.0, vector("cell_turn"), ("rotation",),
        sources=axes("cell_axes", "wrench", "misalignment"),
    ),
    "load cell drift": Trouble(
        "N, 0.03 N·m over 30 s", 3.0, 300.0, vector("cell_drift", 6, CELL), ("drift",),
        sources=lambda size: [
            ("F_drift", "F", "drift", [size / 30 / np.sqrt(6)] * 3),
            ("M_drift", "M", "drift", [0.03 * size / 30 / np.sqrt(6)] * 3),
        ],
    ),
    "gain drift": Trouble("1 over 30 s", 5e-3, 0.2, same("gain_drift", 6), ("gain drift", "tensor")),
    "nonlinearity": Trouble("of full scale", 2e-3, 0.1, same("nonlinearity", 6)),
    "hysteresis": Trouble("of full scale", 2e-3, 0.1, same("hysteresis", 6)),
    "jump": Trouble("N, 0.03 N·m", 5.0, 300.0, vector("jump", 6, CELL), ("jump", "drift")),
    "hum": Trouble("N, 0.03 N·m", 5.0, 30.0, same("hum", 6, CELL), ("resonance",)),
    "delay": Trouble("s", 1e-3, 0.05, scalar("imu_delay"), ("delay",),
                     sources=lambda size: [("late", "omega", "delay", size)]),
    "clock": Trouble("1", 1e-4, 0.005, scalar("imu_clock"), ("clock", "delay")),
    "jitter": Trouble("s", 1e-3, 0.01, scalar("jitter")),
    "filter of the load cell": Trouble("s", 1e-3, 0.05, scalar("cell_filter"), ("delay",)),
    "filter of the IMU": Trouble("s", 1e-3, 0.05, scalar("imu_filter"), ("delay",)),
    "resolution": Trouble("N, 0.03 N·m", 5.0, 300.0, same("cell_step", 6, CELL)),
    "clipping": Trouble("of the range", 0.1, 0.8, same("clipped", 6), ("saturation",)),
    "drops": Trouble("of the samples", 0.05, 0.3, scalar("drops")),
    "spikes": Trouble("N, 0.03 N·m", 100.0, 3000.0, same("spikes", 6, CELL)),
}  # fmt: skip
"""By name; ``delay``, ``mass`` and the like are beyond what is declared."""


# --- plain least squares ---


def common(measured: Measured):
    """Wrench (n, 6) and IMU (n, 6) at the same uniform instants, by straight lines where they are at others."""
    t = np.arange(round(measured.setup.seconds * RATE) + 1) / RATE
    rows = []
    for stamps, parts in ((measured.t_wrench, (measured.force, measured.moment)),
                          (measured.t_imu, (measured.omega, measured.acceleration))):  # fmt: skip
        values = np.hstack(parts)
        rows.append(values if np.array_equal(stamps, t) else np.stack([np.interp(t, stamps, x) for x in values.T], 1))
    return t, *rows


def regressor(omega, alpha):
    """Rows (n, 3, 6) of the moment about the centre of gravity in the six components."""
    rows = []
    for i, j in zip(*np.triu_indices(3), strict=True):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1
        rows.append(alpha @ unit + cross(omega, omega @ unit))
    return np.stack(rows, axis=2)


WINDOW = 19
"""Samples that are fitted for the angular acceleration: good to 3 Hz."""


def least_squares(measured: Measured, force_rows=False, window=WINDOW):
    """The six components by ordinary least squares: what the two estimators rest on, in their plainest form.

    Args:
        measured: a run, best without noise.
        force_rows: False: the moment's rows with the measured force, at the stated r_CG. True: force and moment with
            the mass times the specific force, from the accelerometer, or gravity where it is said to be still (at the
            true attitude); r_CG then has its prior.
        window: samples of the polynomial that gives the angular acceleration.
    """
    _, wrench, imu = common(measured)
    omega = savgol_filter(imu[:, :3], window, 4, axis=0)
    alpha = savgol_filter(imu[:, :3], window, 4, deriv=1, delta=1 / RATE, axis=0)
    rows, n = regressor(omega, alpha), len(omega)
    unit = np.tile(np.eye(3), (n, 1, 1))
    if not force_rows:
        design = np.concatenate([rows, unit], axis=2).reshape(3 * n, 9)
        target = wrench[:, 3:] - cross(measured.r_cg, wrench[:, :3])
        return np.linalg.lstsq(design, target.ravel(), rcond=None)[0][:6]
    if measured.declared_still:
        felt = GRAVITY * base_motion(measured.setup).up[:: FINE // RATE]
    else:
        felt = carried(imu[:, 3:], omega, alpha, measured.r_cg - measured.setup.imu_position)
    push = measured.mass * felt
    arm = np.stack([cross(e, push) for e in np.eye(3)], axis=2)
    none = np.zeros((n, 3, 3))
    force = np.concatenate([np.zeros((n, 3, 6)), none, unit, none], axis=2) / NOISE["force"]
    moment = np.concatenate([rows, arm, none, unit], axis=2) / NOISE["moment"]
    design = np.concatenate([force, moment]).reshape(6 * n, 15)
    target = np.concatenate([
        (wrench[:, :3] - push) / NOISE["force"], (wrench[:, 3:] - cross(measured.r_cg, push)) / NOISE["moment"]
    ]).ravel()  # fmt: skip
    prior = np.zeros(15)
    prior[6:9] = 1 / np.square(SIGMA["r_cg"])
    return np.linalg.solve(design.T @ design + np.diag(prior), design.T @ target)[:6]


@lru_cache
def _untroubled(still, seconds, force_rows):
    return least_squares(measure(still=still, seconds=seconds, noise=0.0, drawn=0.0), force_rows)


def shift(trouble: Trouble, size, seed, *, still=False, force_rows=False, seconds=30.0):
    """By how much a trouble shifts the six components of plain least squares, without noise [kg·m²]."""
    silent = Setup(still=still, seconds=seconds, noise=0.0, drawn=0.0)
    troubled = measure(seed, silent, **trouble.options(size, seed))
    return least_squares(troubled, force_rows) - _untroubled(still, seconds, force_rows)


def size_for(trouble: Trouble, shifts, u, seed, **options):
    """The size that shifts some component by so many standard uncertainties u (6,), at most what is tried at all.

    By proportion, and once more by the power law of two sizes, for what goes with the square or worse.
    """
    reached, sizes = [], [trouble.typical]
    while len(reached) < 2:
        reached.append(np.abs(shift(trouble, sizes[-1], seed, **options) / u).max())
        if not reached[-1] > 1e-3 * shifts:
            return trouble.most
        sizes.append(min(sizes[-1] * shifts / reached[-1], trouble.most))
        if abs(sizes[-1] / sizes[-2] - 1) < 0.1:
            return sizes[-1]
    power = np.log(reached[1] / reached[0]) / np.log(sizes[1] / sizes[0])
    return float(min(sizes[1] * (shifts / reached[1]) ** (1 / np.clip(power, 0.5, 4)), trouble.most))
