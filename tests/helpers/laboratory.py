"""A laboratory in plain NumPy: a rigid body on a moving base, its sensors, and what goes wrong with them.

It shares no code with the packages. Mechanics are evaluated at 4 kHz, sensors sample at 400 Hz. Axes are the body's, B,
which are the base's unless the mounting flexes; Q is the load cell's centre. The base turns by three angles in closed
form about a point that keeps still: the centre of gravity, or one at the end of a lever. SI units throughout.

``measure(seed, still=True, flex_frequency=25.0)`` is one run; every name of :class:`Setup` is an option.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tests.helpers.laboratory_mechanics import (
    FINE,
    INERTIA,
    MASS,
    R_CG,
    ZERO,
    base_motion,
    carried,
    oscillator,
    wrench_of,
)

RATE = 400
"""Samples a second of both sensors."""
FULL_SCALE = np.array([300.0, 300, 500, 20, 20, 20])
NOISE = {"force": 0.5, "moment": 0.03, "gyro": 1e-3, "accelerometer": 0.02}
"""Standard deviation of a sample."""
SIGMA = {"force": (0.69, 0.42, 1.4), "moment": (0.014, 0.016, 0.019), "gyro": (0.006,) * 3,
         "accelerometer": (0.05,) * 3, "r_cg": (1.5e-4,) * 3}  # fmt: skip
"""Standard deviations of the constants that each run draws and declares: offsets, and the error of r_CG."""
ZERO6 = (0.0,) * 6


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What is there, and every trouble, none unless it is given; three numbers per axis, six for force and moment."""

    still: bool = False
    """Whether the base keeps the centre of gravity where it is."""
    seconds: float = 30.0
    noise: float = 1.0
    """Times ``NOISE``."""
    drawn: float = 1.0
    """Times ``SIGMA``: of what is drawn, not of what is declared."""
    rate: int = RATE
    """Samples a second of both sensors; divides ``FINE``."""
    pace: float = 1.0
    """Times the frequencies of the motion."""
    swing: tuple = (1.0,) * 3
    """Times the three angles of the motion."""
    inertia: np.ndarray | None = None
    """Of another body, (3, 3)."""
    mass: float = MASS
    """Of another body [kg]."""
    imu_position: tuple = (0.02, 0.03, -0.04)
    """The accelerometer, from Q, as declared."""
    imu_on_body: bool = False
    """Whether the IMU turns with the body where the mounting flexes; else it is on the base."""
    # base and body
    still_miss: tuple = ZERO
    """Centre of gravity from the point that keeps still, beside the lever where there is one [m]."""
    declared_still: bool | None = None
    """Whether the experiment says that it is still; None: the truth."""
    tilt: tuple = ZERO
    """Rotation vector that turns the vertical of the level base [rad]."""
    vibration: tuple = ZERO
    """Acceleration of the base along its axes, amplitude [m/s²]."""
    shaking: tuple = ZERO
    """The same of its three angles [rad/s²]."""
    vibration_frequency: float = 47.3
    flex_frequency: float | tuple = 0.0
    """Of the body turning on its mounting about Q, one or one per axis [Hz]; 0: rigid."""
    flex_damping: float = 0.03
    """Of critical."""
    ringing: float = 0.0
    """Knocks on the body, twice a second, that make the moment ring with so much [N·m rms]."""
    cable_moment: float = 0.0
    """Torsional stiffness of a cable to the outside [N·m/rad]."""
    cable_force: float = 0.0
    """Force of its end, at the height of the centre of gravity, across the vertical [N/rad]."""
    cable_attitude: tuple = ZERO
    """Rotation vector of the base where the cable is slack [rad]."""
    drag: tuple = ZERO
    """Moment of the air against the angular velocity [N·m·s/rad]."""
    drag_squared: tuple = ZERO
    """The same against its square [N·m·s²/rad²]."""
    slosh_mass: float = 0.0
    """Part of the body's mass that hangs on springs [kg]."""
    slosh_frequency: float = 4.0
    slosh_damping: float = 0.1
    slosh_position: tuple = (0.05, 0.03, 0.08)
    """From the centre of gravity, at rest [m]."""
    mounted: tuple = ZERO
    """By how much the body stands elsewhere on the load cell than stated [m]."""
    slip: tuple = ZERO
    """By how much the body slides on the load cell in the middle of the run [m]."""
    # what the experiment says of the body
    mass_error: float = 0.0
    """Stated less true mass [kg]."""
    r_cg_error: tuple = ZERO
    """Stated less true r_CG, beside what is drawn [m]."""
    # IMU
    gyro_scale: tuple = ZERO
    gyro_turn: tuple = ZERO
    """Rotation vector of the gyro's axes from the body's [rad]."""
    imu_turn: tuple = ZERO
    """The same of gyro and accelerometer [rad]."""
    gyro_g: np.ndarray | tuple = ZERO
    """Angular velocity that a specific force feigns, (3, 3) or its diagonal [rad/s per m/s²]."""
    gyro_drift: tuple = ZERO
    """Change of its zero over the run [rad/s]."""
    accelerometer_scale: tuple = ZERO
    accelerometer_offset: tuple = ZERO
    """Beside what is drawn [m/s²]."""
    imu_position_error: tuple = ZERO
    """True less declared position [m]."""
    # load cell
    cell_gain: tuple = ZERO6
    cross_talk: np.ndarray | None = None
    """(6, 6): what each true component adds to each channel, in SI units."""
    cell_turn: tuple = ZERO
    """Rotation vector of the load cell's axes from the body's, any angle [rad]."""
    cell_drift: tuple = ZERO6
    """Change of its zeros over the run."""
    warming: tuple = ZERO6
    """Change of its zeros over the run as it warms up."""
    warming_time: float = 40.0
    """Time constant of that [s]."""
    gain_drift: tuple = ZERO6
    """Change of its gains over the run, from right ones at the start."""
    nonlinearity: tuple = ZERO6
    """Error at full scale, as its square [parts of full scale]."""
    hysteresis: tuple = ZERO6
    """Between rising and falling [parts of full scale]."""
    jump: tuple = ZERO6
    """Of the zeros in the middle of the run."""
    hum: tuple = ZERO6
    """Amplitude of 50 Hz on its channels."""
    # sampling
    imu_delay: float = 0.0
    """An IMU's sample is that of so long before its stamp [s]."""
    gyro_axis_delay: tuple = ZERO
    """The same of each axis of the gyro alone, beside it."""
    imu_clock: float = 0.0
    """By how much the IMU's second is longer, in parts."""
    jitter: float = 0.0
    """Standard deviation of every stamp [s]."""
    cell_filter: float = 0.0
    """Delay of slow signals by a second-order Butterworth before the load cell's sampling [s]."""
    imu_filter: float = 0.0
    """The same of the IMU."""
    accelerometer_filter: float = 0.0
    """The same of the accelerometer alone, beside it."""
    cell_step: tuple = ZERO6
    """Resolution of the load cell's numbers."""
    imu_step: tuple = ZERO6
    """Of the IMU's, gyro first."""
    clipped: tuple = ZERO6
    """Part of each component's range on each side of its mean, that the load cell's end of range takes."""
    drops: float = 0.0
    """Part of both sensors' samples that is missing, five in a row on average."""
    spikes: tuple = ZERO6
    """Height of wrong samples of the load cell, of either sign."""
    spike_rate: float = 1.0
    """How many a second."""

    @property
    def tensor(self):
        return INERTIA if self.inertia is None else np.asarray(self.inertia)


@dataclass(frozen=True)
class Measured:
    """What both sensors wrote of one run, and what the experiment says beside it."""

    t_wrench: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    t_imu: np.ndarray
    omega: np.ndarray
    acceleration: np.ndarray
    mass: float
    """As stated."""
    r_cg: np.ndarray
    """As stated."""
    setup: Setup
    seed: int

    @property
    def truth(self):
        """The six components I11, I12, I13, I22, I23, I33 of the body."""
        return self.setup.tensor[np.triu_indices(3)]

    @property
    def declared_still(self):
        return self.setup.still if self.setup.declared_still is None else self.setup.declared_still


def measure(seed=0, setup=None, **options) -> Measured:
    """One run: mechanics, sensors, and the constants drawn by the seed."""
    setup = replace(setup or Setup(), **options)
    rng = np.random.default_rng([20160, seed])
    draw = {name: setup.drawn * np.array(sigma) * rng.standard_normal(3) for name, sigma in SIGMA.items()}
    base = base_motion(setup)
    wrench, seen = wrench_of(setup, base, np.random.default_rng([20161, seed]))
    imu = imu_signals(setup, seen)
    t = np.arange(round(setup.seconds * setup.rate) + 1) / setup.rate
    wrench, imu = behind_filter(wrench, setup.cell_filter), behind_filter(imu, setup.imu_filter)
    imu[:, 3:] = behind_filter(imu[:, 3:], setup.accelerometer_filter)
    wrench = cell_reading(setup, wrench[:: FINE // setup.rate], t)
    taken = t * (1 + setup.imu_clock) - setup.imu_delay
    axes = [at(base.t, imu[:, [axis]], taken - late) for axis, late in enumerate(setup.gyro_axis_delay)]
    imu = np.hstack([*axes, at(base.t, imu[:, 3:], taken)])
    imu[:, :3] += np.outer(t / t[-1], setup.gyro_drift) + draw["gyro"]
    imu[:, 3:] += np.add(setup.accelerometer_offset, draw["accelerometer"])
    white = rng.standard_normal((len(t), 12)) * setup.noise * np.repeat(list(NOISE.values()), 3)
    wrench = wrench + np.concatenate([draw["force"], draw["moment"]]) + white[:, :6]
    wrench, imu = digits(setup, wrench, rng), rounded(imu + white[:, 6:], setup.imu_step)
    (t_wrench, wrench), (t_imu, imu) = (recorded(setup, t, rows, rng) for rows in (wrench, imu))
    r_cg = R_CG + draw["r_cg"] + setup.r_cg_error
    return Measured(t_wrench, wrench[:, :3], wrench[:, 3:], t_imu, imu[:, :3], imu[:, 3:], setup.mass + setup.mass_error,
                    r_cg, setup, seed)  # fmt: skip


def imu_signals(setup, seen):
    """Gyro and accelerometer in their own axes, (n, 6), before their zeros and noise."""
    omega, alpha, at_q = seen
    there = carried(at_q, omega, alpha, np.add(setup.imu_position, setup.imu_position_error))
    imu, gyro = Rotation.from_rotvec(setup.imu_turn), Rotation.from_rotvec(setup.gyro_turn)
    felt, spin = imu.inv().apply(there), (imu * gyro).inv().apply(omega)
    feigned = np.asarray(setup.gyro_g)
    spin = spin * np.add(1, setup.gyro_scale) + (felt * feigned if feigned.ndim == 1 else felt @ feigned.T)
    return np.hstack([spin, felt * np.add(1, setup.accelerometer_scale)])


def cell_reading(setup, wrench, t):
    """The load cell's channels, (n, 6), before its drawn zeros and noise."""
    axes, part = Rotation.from_rotvec(setup.cell_turn).inv(), (t / t[-1])[:, None]
    read = np.hstack([axes.apply(wrench[:, :3]), axes.apply(wrench[:, 3:])])
    if setup.cross_talk is not None:
        read = read + read @ np.asarray(setup.cross_talk).T
    read = read * (np.add(1, setup.cell_gain) + part * setup.gain_drift)
    read = read + np.asarray(setup.nonlinearity) * read**2 / FULL_SCALE + lag_of_loops(setup, read)
    warmth = np.expm1(-t / setup.warming_time) / np.expm1(-t[-1] / setup.warming_time)
    read = read + part * setup.cell_drift + np.outer(warmth, setup.warming) + (part > 0.5) * np.asarray(setup.jump)
    return read + np.outer(np.sin(2 * np.pi * 50 * t + 0.4), setup.hum)


def lag_of_loops(setup, read):
    """Hysteresis: the mean of three elastic-plastic elements, as Prandtl and Ishlinskii, half the loop's width at most."""
    if not np.any(setup.hysteresis):
        return 0.0
    radii = np.multiply.outer([0.01, 0.03, 0.1], FULL_SCALE)
    held, loops = np.tile(read[0], (3, 1)), np.empty((len(read), 6))
    for k, row in enumerate(read):
        held = np.minimum(np.maximum(held, row - radii), row + radii)
        loops[k] = ((row - held) / radii).mean(axis=0)
    return loops * FULL_SCALE * setup.hysteresis / 2


def behind_filter(signals, delay):
    """Signals behind a second-order Butterworth that delays slow ones by so long."""
    if not delay:
        return signals
    cutoff = np.sqrt(2) / delay
    return signals[0] + cutoff**2 * oscillator(signals - signals[0], cutoff, np.sqrt(0.5))[0]


def at(t, signals, instants):
    """Signals at other instants; before the start and after the end they are as at these."""
    instants = np.clip(instants, t[0], t[-1])
    places = instants * FINE
    if np.allclose(places, np.round(places), rtol=0, atol=1e-6):
        return signals[np.round(places).astype(int)]
    return CubicSpline(t, signals)(instants)


def digits(setup, wrench, rng):
    """Wrong samples, the end of the range, and rounding."""
    if np.any(setup.spikes):
        hit = rng.random(len(wrench)) < setup.spike_rate / setup.rate
        wrench = wrench + np.outer(hit * rng.choice([-1, 1], len(hit)), setup.spikes)
    low, high = wrench.min(axis=0), wrench.max(axis=0)
    room = (high - low) * np.asarray(setup.clipped) / 2
    return rounded(np.clip(wrench, low + room, high - room), setup.cell_step)


def rounded(rows, step):
    step = np.asarray(step)
    return np.where(step > 0, np.round(rows / np.where(step > 0, step, 1)) * step, rows)


def recorded(setup, t, rows, rng):
    """The samples that arrive, with their stamps."""
    if setup.jitter:
        apart = 1e-6 * np.arange(len(t))
        t = np.maximum.accumulate(np.sort(t + setup.jitter * rng.standard_normal(len(t))) - apart) + apart
    if not setup.drops:
        return t, rows
    burst = 5
    starts = rng.random(len(t)) < setup.drops / burst
    lost = np.convolve(starts, np.ones(burst))[: len(t)] > 0
    return t[~lost], rows[~lost]
