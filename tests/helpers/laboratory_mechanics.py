"""Mechanics of tests/helpers/laboratory.py at 4 kHz: the base's motion, the body on it, flexible mounting, and what pulls on it.

Axes are the base's, B, which are the body's unless the mounting flexes; Q is the load cell's centre.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import eigh
from scipy.signal import cont2discrete, lfilter
from scipy.spatial.transform import Rotation

FINE = 4000
"""Instants a second."""
GRAVITY = 9.81
INERTIA = np.array([[0.380, 0.004, -0.006], [0.004, 0.020, 0.002], [-0.006, 0.002, 0.384]])
"""About the centre of gravity [kg·m²]."""
MASS, R_CG = 19.7, np.array([0.004, -0.003, 0.053])
LEVER = np.array([0.010, -0.005, 0.110])
"""Centre of gravity from the point that keeps still, unless that is the centre of gravity."""
ZERO = (0.0,) * 3
WORST_BEND = 0.2
"""Angle [rad] at which a mounting is no longer one."""


@dataclass(frozen=True)
class Motion:
    """The base at some instants, in its own axes: of all times here, the finest."""

    t: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray
    up: np.ndarray
    """Opposite to gravity."""
    attitude: np.ndarray
    """Rotation vector from level."""
    fixed: np.ndarray
    """Specific force at the point of the base that keeps still, gravity and vibration [m/s²]."""


def base_angles(t, length, shaking=ZERO, frequency=1.0, swing=(1.0,) * 3, pace=1.0):
    """Yaw, pitch and roll with their first and second derivatives, (3, n, 3): four sines an axis, at rest at both ends."""
    sines = np.array([[0.83, 1.11, 1.42, 1.87], [0.91, 1.23, 1.58, 1.96], [0.80, 1.02, 1.36, 1.74]])
    phase = np.array([[0.3, 2.1, 4.4, 1.2], [5.0, 0.9, 3.3, 2.6], [1.7, 4.0, 0.2, 5.5]])
    turn = 2 * np.pi * pace * sines
    angle = np.multiply.outer(t, turn) + phase
    sums = np.stack([np.sin(angle), turn * np.cos(angle), -(turn**2) * np.sin(angle)]).sum(axis=-1)
    ease = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])  # flat to the fourth derivative
    rest, ramp = 1.0, 2.0
    rising, falling = (np.clip((x - rest) / ramp, 0, 1) for x in (t, length - t))
    slopes = [ease, ease.deriv(), ease.deriv(2)]
    up, down = ([p(x) * (sign / ramp) ** k for k, p in enumerate(slopes)] for x, sign in ((rising, 1), (falling, -1)))
    gain = up[0] * down[0], up[1] * down[0] + up[0] * down[1], up[2] * down[0] + 2 * up[1] * down[1] + up[0] * down[2]
    w = 2 * np.pi * frequency
    line = np.multiply.outer([-np.sin(w * t) / w**2, -np.cos(w * t) / w, np.sin(w * t)], shaking)
    g0, g1, g2 = (g[:, None] for g in gain)
    s0, s1, s2 = 0.08 * np.multiply(swing, sums)
    return np.stack([g0 * s0, g1 * s0 + g0 * s1, g2 * s0 + 2 * g1 * s1 + g0 * s2]) + line


def base_motion(setup) -> Motion:
    """The base's motion, turned by yaw, then pitch, then roll; in closed form, computed once for all runs alike."""
    vectors = (tuple(map(float, vector)) for vector in (setup.tilt, setup.vibration, setup.shaking, setup.swing))
    return _base_motion(setup.seconds, *vectors, setup.pace, setup.vibration_frequency)


@lru_cache(maxsize=2)
def _base_motion(length, tilt, vibration, shaking, swing, pace, frequency):
    t = np.arange(round(length * FINE) + 1) / FINE
    angles, rates, seconds = base_angles(t, length, shaking, frequency, swing, pace)
    (a1, b1, c1), (a2, b2, c2) = rates.T, seconds.T
    (sb, sc), (cb, cc) = np.sin(angles.T[1:]), np.cos(angles.T[1:])
    omega = [c1 - a1 * sb, b1 * cc + a1 * cb * sc, a1 * cb * cc - b1 * sc]
    alpha = [
        c2 - a2 * sb - a1 * b1 * cb,
        b2 * cc - b1 * c1 * sc + a2 * cb * sc - a1 * b1 * sb * sc + a1 * c1 * cb * cc,
        a2 * cb * cc - a1 * b1 * sb * cc - a1 * c1 * cb * sc - b2 * sc - b1 * c1 * cc,
    ]
    turn = Rotation.from_euler("ZYX", angles)
    up = turn.inv().apply(Rotation.from_rotvec(tilt).apply([0, 0, 1]))
    line = np.outer(np.sin(2 * np.pi * frequency * t), vibration)
    return Motion(t, np.stack(omega, 1), np.stack(alpha, 1), up, turn.as_rotvec(), GRAVITY * up + line)


def cross(a, b):
    """The product of vectors (n, 3) or (3,), faster than NumPy's."""
    a, b = np.asarray(a, float).T, np.asarray(b, float).T
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]], axis=-1)


def carried(force, omega, alpha, arm):
    """The specific force at another point of the same rigid body, an arm away."""
    return force + cross(alpha, arm) + cross(omega, cross(omega, arm))


def still_point(setup):
    """Centre of gravity from the point of the base that keeps still."""
    return np.add(np.zeros(3) if setup.still else LEVER, setup.still_miss)


def wrench_of(setup, base, rng):
    """What the mounting exerts on the body at Q, (n, 6) in the base's axes; the IMU's motion: omega, alpha, force at Q."""
    at_q = carried(base.fixed, base.omega, base.alpha, still_point(setup) - R_CG)
    r = R_CG + setup.mounted + np.outer(base.t > setup.seconds / 2, setup.slip)
    load = outside(setup, base, at_q, r)
    seen = base.omega, base.alpha, at_q
    if not np.any(setup.flex_frequency):
        return needed(setup, *seen, r) - load, seen
    bent, body = bent_mounting(setup, base, at_q, r, load, rng)
    wrench = body[3]
    turned = np.hstack([bent.apply(wrench[:, :3]), bent.apply(wrench[:, 3:])])
    return turned, body[:3] if setup.imu_on_body else seen


def needed(setup, omega, alpha, at_q, r):
    """Newton and Euler: the wrench at Q that this motion of the body takes."""
    force = setup.mass * carried(at_q, omega, alpha, r)
    spin = omega @ setup.tensor
    return np.hstack([force, alpha @ setup.tensor + cross(omega, spin) + cross(r, force)])


def outside(setup, base, at_q, r):
    """The wrench about Q of all else that pulls on the body: cable, air, and a mass that moves inside."""
    load = np.zeros((len(base.t), 6))
    if setup.cable_moment or setup.cable_force:
        turned = base.attitude - np.asarray(setup.cable_attitude)
        pull = -setup.cable_force * cross(turned, [0, 0, 1])
        load += np.hstack([pull, cross([0, 0, R_CG[2]], pull) - setup.cable_moment * turned])
    load[:, 3:] -= (np.asarray(setup.drag) + np.abs(base.omega) * setup.drag_squared) * base.omega
    return load + sloshing(setup, base, at_q, r) if setup.slosh_mass else load


def sloshing(setup, base, at_q, r):
    """What a mass on springs exerts on the body beyond what it would if it were fixed."""
    place = r + np.asarray(setup.slosh_position)
    felt = carried(at_q, base.omega, base.alpha, place)
    x, v, a = np.zeros((3, *felt.shape))
    own = np.zeros_like(felt)
    for _ in range(4):  # its oscillator, driven by what its own motion in turning axes adds
        own = 2 * cross(base.omega, v) + carried(0.0, base.omega, base.alpha, x)
        x, v, a = oscillator(felt[0] - felt - own, 2 * np.pi * setup.slosh_frequency, setup.slosh_damping)
    extra = a + own
    moment = cross(place + x, felt + extra) - cross(place, felt)
    return -setup.slosh_mass * np.hstack([extra, moment])


def oscillator(drive, omega, damping):
    """x'' + 2 ζ ω x' + ω² x = drive from rest: x, x', x'', exact for a drive that is straight between the instants."""
    a = np.array([[0, 1], [-(omega**2), -2 * damping * omega]])
    system = cont2discrete((a, np.array([[0], [1]]), np.eye(2), np.zeros((2, 1))), 1 / FINE, method="foh")
    poles = np.poly(system[0])
    # the two outputs' numerators from their first samples after an impulse
    response, state = [system[3]], system[1]
    for _ in range(2):
        response.append(system[2] @ state)
        state = system[0] @ state
    impulse = np.array(response)[:, :, 0]
    x, v = (lfilter(np.convolve(impulse[:, k], poles)[:3], poles, drive, axis=0) for k in (0, 1))
    return x, v, drive - 2 * damping * omega * v - omega**2 * x


def bent_mounting(setup, base, at_q, r, load, rng):
    """The body on springs that let it turn about Q by small angles: the turn, and its motion and wrench in its own axes.

    The springs are set so that the body is level at rest. Its equations in full, with rotation vectors to second order,
    stand on the right of the linear oscillators, whose answer is put in again until nothing changes.
    """
    shift = setup.mass * (R_CG @ R_CG * np.eye(3) - np.outer(R_CG, R_CG))
    about_q = setup.tensor + shift
    natural = 2 * np.pi * np.broadcast_to(setup.flex_frequency, 3)
    stiffness = natural**2 * np.diag(about_q)
    squares, modes = eigh(np.diag(stiffness), about_q)
    damping = setup.flex_damping * np.sqrt(squares) / natural.mean()  # of each mode: dampers in the springs' proportion

    def answer(torque):
        parts = [oscillator(torque @ modes[:, k], np.sqrt(squares[k]), damping[k]) for k in range(3)]
        return [np.stack(signal, axis=1) @ modes.T for signal in zip(*parts, strict=True)]

    knocks = np.zeros_like(at_q)
    if setup.ringing:
        places = rng.integers(FINE, len(knocks) - FINE, round(2 * setup.seconds))
        knocks[places] = rng.standard_normal((len(places), 3))
        ring = answer(knocks)[0] * stiffness
        knocks *= setup.ringing / np.sqrt((ring**2).mean())
    phi, rate, acceleration = np.zeros((3, *at_q.shape))
    for _ in range(30):
        back = Rotation.from_rotvec(-phi)
        turning, speed = back.apply(base.omega), rate - cross(phi, rate) / 2
        alpha = back.apply(base.alpha) - cross(speed, turning) + acceleration - cross(phi, acceleration) / 2
        omega, force = turning + speed, back.apply(at_q)
        wrench = needed(setup, omega, alpha, force, r) - load
        torque = acceleration @ about_q - wrench[:, 3:]
        before, (phi, rate, acceleration) = phi, answer(torque - torque[0] + knocks)
        if not np.abs(phi).max() < WORST_BEND:
            raise ValueError(f"the mounting bends by more than {WORST_BEND} rad: make it stiffer")
        if np.abs(phi - before).max() < 1e-7 * np.abs(phi).max():
            break
    wrench[:, 3:] -= knocks  # the mounting does not exert the knock itself
    return Rotation.from_rotvec(phi), (omega, alpha, force, wrench)
