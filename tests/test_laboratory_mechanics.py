"""The laboratory's body, base and mounting against point masses, MuJoCo, SciPy's integrator and closed forms."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from tests.helpers.laboratory import RATE, Setup, measure
from tests.helpers.laboratory_mechanics import (
    FINE,
    GRAVITY,
    INERTIA,
    MASS,
    R_CG,
    base_angles,
    base_motion,
    carried,
    cross,
    oscillator,
    sloshing,
    still_point,
    wrench_of,
)
from tests.helpers.troubles import TROUBLES, least_squares, shift

SHORT = 6.0
SILENT = Setup(seconds=SHORT, noise=0.0, drawn=0.0)


def point_masses():
    """Eight of them with the body's mass, centre of gravity and tensor: masses (8,) and places from Q (8, 3)."""
    second = np.trace(INERTIA) / 2 * np.eye(3) - INERTIA  # sum of m x xᵀ about the centre of gravity
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    return np.full(8, MASS / 8), R_CG + corners @ np.linalg.cholesky(second / MASS).T


def attitudes(setup, t):
    return Rotation.from_euler("ZYX", base_angles(t, setup.seconds)[0])


def second_derivative(function, t, h=1e-3):
    """Of a vector in the inertial frame, good to h⁴."""
    return (16 * (function(t - h) + function(t + h)) - function(t - 2 * h) - function(t + 2 * h)
            - 30 * function(t)) / (12 * h**2)  # fmt: skip


@pytest.mark.parametrize("options", [{}, {"still": True}, {"still": True, "still_miss": (2e-3, -1e-3, 3e-3)},
                                     {"tilt": (0.1, -0.05, 0.0)}])  # fmt: skip
def test_force_and_moment_are_those_of_point_masses(options):
    """Their places in the inertial frame, differentiated twice: no rule for turning axes is used. h⁴ leaves 1e-6."""
    setup = replace(SILENT, **options)
    base = base_motion(setup)
    wrench, _ = wrench_of(setup, base, None)
    some = np.arange(4100, len(base.t) - 4100, 970)
    t, (masses, places) = base.t[some], point_masses()
    vertical = Rotation.from_rotvec(setup.tilt).apply([0.0, 0.0, GRAVITY])
    back = attitudes(setup, t).inv()
    total, q = np.zeros((len(t), 6)), still_point(setup) - R_CG
    for mass, place in zip(masses, places, strict=True):
        where = lambda t, place=place: attitudes(setup, t).apply(q + place)  # noqa: E731
        force = back.apply(mass * (second_derivative(where, t) + vertical))
        total += np.hstack([force, np.cross(place, force)])
    np.testing.assert_allclose(wrench[some], total, atol=2e-5)


def test_the_imu_feels_its_own_motion():
    """Gyro against the change of the attitude, accelerometer against the second derivative of its place."""
    run = measure(0, SILENT)
    some = slice(410, -410, 97)
    t, h = run.t_imu[some], 1e-4
    turn = attitudes(SILENT, t)
    rate = (attitudes(SILENT, t - h).inv() * attitudes(SILENT, t + h)).as_rotvec() / (2 * h)
    place = still_point(SILENT) - R_CG + SILENT.imu_position
    felt = turn.inv().apply(second_derivative(lambda t: attitudes(SILENT, t).apply(place), t) + [0, 0, GRAVITY])
    np.testing.assert_allclose(run.omega[some], rate, atol=1e-5)
    np.testing.assert_allclose(run.acceleration[some], felt, atol=2e-5)


def test_the_base_starts_and_ends_at_rest_and_turns_as_it_should():
    base = base_motion(Setup())
    resting = (base.t < 1) | (base.t > 29)
    assert np.abs(base.omega[resting]).max() == np.abs(base.alpha[resting]).max() == 0
    assert 0.25 < np.abs(base.attitude).max() < 0.35
    assert (base.omega.std(axis=0) > 0.8).all()
    slope = CubicSpline(base.t, base.omega).derivative()(base.t)
    np.testing.assert_allclose(base.alpha, slope, atol=2e-4)  # h³ at the run's ends


@pytest.mark.parametrize("still", [False, True])
def test_without_noise_plain_least_squares_return_the_tensor(still):
    run = measure(0, Setup(still=still, noise=0.0, drawn=0.0))
    for force_rows in (False, True):
        found = least_squares(run, force_rows, window=9)
        np.testing.assert_allclose(found, run.truth, rtol=1e-4)


MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -{gravity}"/>
  <worldbody>
    <body name="base">
      <freejoint/>
      <geom type="sphere" size="0.1" mass="50"/>
      <body name="load">
        <inertial pos="{place}" mass="{mass}" fullinertia="{inertia}"/>
        {hinges}
        <site name="Q"/>
      </body>
    </body>
  </worldbody>
  <sensor><force site="Q"/><torque site="Q"/></sensor>
</mujoco>
"""


def mujocos_wrench(setup, base, first, last):
    """The wrench that three springy hinges at Q exert, in the base's axes: MuJoCo's equations, RK4 at 2 kHz.

    The base's acceleration is prescribed; of the hinges' it is what leaves MuJoCo's inverse dynamics no force.
    """
    numbers = lambda values: " ".join(f"{x:.12g}" for x in values)  # noqa: E731
    about_q = np.diag(INERTIA + MASS * (R_CG @ R_CG * np.eye(3) - np.outer(R_CG, R_CG)))
    natural = 2 * np.pi * setup.flex_frequency
    at_rest = np.cross(R_CG, [0, 0, MASS * GRAVITY])
    hinges = [
        f'<joint type="hinge" axis="{numbers(axis)}" stiffness="{natural**2 * about:.12g}" '
        f'damping="{2 * setup.flex_damping * natural * about:.12g}" springref="{moment / (natural**2 * about):.12g}"/>'
        for axis, about, moment in zip(np.eye(3), about_q, at_rest, strict=True)
    ]
    inertia = INERTIA[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    model = mujoco.MjModel.from_xml_string(MODEL.format(
        gravity=GRAVITY, place=numbers(R_CG), mass=MASS, inertia=numbers(inertia), hinges="".join(hinges)
    ))  # fmt: skip
    data, q = mujoco.MjData(model), still_point(setup) - R_CG
    turn = Rotation.from_rotvec(base.attitude)
    place = np.hstack([turn.apply(q), turn.as_quat()[:, [3, 0, 1, 2]]])
    speed = np.hstack([turn.apply(cross(base.omega, q)), base.omega])
    change = np.hstack([turn.apply(carried(0.0, base.omega, base.alpha, q)), base.alpha])
    mass = np.zeros((3, 9))

    def slope(k, state):
        data.qpos[:], data.qvel[:] = [*place[k], *state[:3]], [*speed[k], *state[3:]]
        data.qacc[:] = [*change[k], 0, 0, 0]
        mujoco.mj_inverse(model, data)
        for row, unit in zip(mass, np.eye(9)[6:], strict=True):
            mujoco.mj_mulM(model, data, row, unit)
        return np.concatenate([state[3:], -np.linalg.solve(mass[:, 6:], data.qfrc_inverse[6:])])

    state, readings = np.zeros(6), []
    for k in range(first, last, 2):
        a = slope(k, state)
        data.qacc[6:] = a[3:]
        mujoco.mj_inverse(model, data)
        bent = Rotation.from_euler("XYZ", state[:3])
        readings.append(bent.apply(data.sensordata.reshape(2, 3)).ravel())
        h = 2 / FINE
        b = slope(k + 1, state + h / 2 * a)
        c = slope(k + 1, state + h / 2 * b)
        d = slope(k + 2, state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
    return np.array(readings)


def test_a_flexible_mounting_is_mujocos():
    """From rest through the start of the motion; second order in angles of 1e-3 rad is what is left."""
    setup = replace(SILENT, flex_frequency=25.0)
    base = base_motion(setup)
    first, last = FINE - 100, 9 * FINE // 4
    flexible, _ = wrench_of(setup, base, None)
    rigid, _ = wrench_of(SILENT, base, None)
    effect = (flexible - rigid)[first:last:2]
    error = flexible[first:last:2] - mujocos_wrench(setup, base, first, last)
    assert np.abs(effect[:, 3:]).max() > 0.03
    assert (np.abs(error).max(axis=0) < 0.01 * np.abs(effect).max(axis=0)).all()


def test_a_flexible_mounting_adds_the_square_of_the_frequencies():
    """Of each sine, least disturbed by gravity and lever in I33; an IMU that turns with the body sees most of it."""
    trouble = TROUBLES["flexible mounting"]
    on_base = shift(trouble, 1.0, 0, seconds=8.0)[[0, 5]] / INERTIA[[0, 2], [0, 2]]
    assert (0.8 / 25) ** 2 < on_base[1] < (2.0 / 25) ** 2
    on_body = measure(0, SILENT, seconds=8.0, flex_frequency=25.0, imu_on_body=True)
    part = (least_squares(on_body) / on_body.truth - 1)[[0, 5]]
    assert (np.abs(part) < 0.2 * on_base).all()


def test_knocks_ring_as_loudly_as_they_should_and_at_the_mountings_frequency():
    quiet, loud = (measure(2, SILENT, flex_frequency=25.0, ringing=size) for size in (0.0, 1.7))
    ring = loud.moment - quiet.moment
    assert np.sqrt((ring**2).mean()) == pytest.approx(1.7, rel=0.02)
    spectrum = np.abs(np.fft.rfft(ring, axis=0)).sum(axis=1)
    assert np.fft.rfftfreq(len(ring), 1 / RATE)[spectrum.argmax()] == pytest.approx(25, abs=1.0)
    np.testing.assert_array_equal(loud.omega, quiet.omega)


def test_an_oscillator_answers_a_ramp_as_the_closed_form():
    t = np.arange(FINE) / FINE
    omega, zeta = 2 * np.pi * 7, 0.1
    damped = omega * np.sqrt(1 - zeta**2)
    wave = 2 * zeta / omega * np.cos(damped * t) + (2 * zeta**2 - 1) / damped * np.sin(damped * t)
    x, v, a = oscillator(t, omega, zeta)
    np.testing.assert_allclose(x, (t - 2 * zeta / omega + np.exp(-zeta * omega * t) * wave) / omega**2, atol=1e-12)
    np.testing.assert_allclose(v, CubicSpline(t, x).derivative()(t), atol=1e-6)
    np.testing.assert_allclose(a, CubicSpline(t, v).derivative()(t), atol=1e-4)


def test_a_sloshing_mass_moves_as_newton_says():
    """SciPy integrates its place in the inertial frame; force and moment are its reaction less the fixed mass's."""
    setup = replace(SILENT, slosh_mass=0.5)
    base = base_motion(setup)
    q, p = still_point(setup) - R_CG, np.asarray(setup.slosh_position) + R_CG
    at_q = carried(base.fixed, base.omega, base.alpha, q)
    load = sloshing(setup, base, at_q, np.tile(R_CG, (len(base.t), 1)))
    omega = 2 * np.pi * setup.slosh_frequency
    spin = CubicSpline(base.t, base.omega)
    weight = np.array([0, 0, GRAVITY])

    def anchor(t):
        turn = attitudes(setup, np.array([t]))
        return turn, turn.apply(q + p)[0], turn.apply(np.cross(spin(t), q + p))[0]

    def slope(t, state):
        turn, place, velocity = anchor(t)
        off = turn.inv().apply(state[:3] - place)[0]
        drift = turn.inv().apply(state[3:] - velocity)[0] - np.cross(spin(t), off)
        spring = weight - omega**2 * off - 2 * setup.slosh_damping * omega * drift
        return np.concatenate([state[3:], turn.apply(spring)[0] - weight])

    start, some = FINE, np.arange(FINE, 2 * FINE, 50)
    _, place, velocity = anchor(base.t[start])
    state = solve_ivp(slope, (1.0, 2.0), [*place, *velocity], t_eval=base.t[some], rtol=1e-8, atol=1e-10)
    where, pull, there = [], [], p + q
    for t, column in zip(state.t, state.y.T, strict=True):
        turn = anchor(t)[0]
        where.append(turn.inv().apply(column[:3])[0] - there)
        pull.append(setup.slosh_mass * turn.inv().apply(slope(t, column)[3:] + weight)[0])
    where, pull = np.array(where), np.array(pull)
    fixed = setup.slosh_mass * carried(at_q, base.omega, base.alpha, p)[some]
    assert np.abs(where).max() > 1e-3
    expected = np.hstack([fixed - pull, np.cross(p, fixed) - np.cross(p + where, pull)])
    np.testing.assert_allclose(load[some], expected, atol=2e-4 * np.abs(expected).max())
