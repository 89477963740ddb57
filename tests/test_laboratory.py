"""The laboratory of tests/laboratory.py against point masses, MuJoCo, SciPy's integrator and closed forms."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from rig.runs import read
from tests import laboratory_runs
from tests.laboratory import FULL_SCALE, NOISE, RATE, SIGMA, Setup, measure
from tests.laboratory_mechanics import (
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
from tests.troubles import TROUBLES, least_squares, shift, size_for
from uq.experiment.experiment import Experiment

SHORT = 6.0
SILENT = Setup(seconds=SHORT, noise=0.0, drawn=0.0)


def difference(**options):
    """What options change in a silent run: wrench (n, 6) and IMU (n, 6)."""
    runs = [measure(4, SILENT), measure(4, SILENT, **options)]
    wrench, imu = ([np.hstack([getattr(run, a), getattr(run, b)]) for run in runs]
                   for a, b in (("force", "moment"), ("omega", "acceleration")))  # fmt: skip
    return wrench[1] - wrench[0], imu[1] - imu[0]


def clean():
    run = measure(4, SILENT)
    return np.hstack([run.force, run.moment]), np.hstack([run.omega, run.acceleration])


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


def test_cable_and_air_pull_as_their_laws_say():
    base = base_motion(SILENT)
    turned, omega = base.attitude[:: FINE // RATE], base.omega[:: FINE // RATE]
    cable, _ = difference(cable_moment=0.1, cable_force=2.0, cable_attitude=(0.0, 0.1, 0.0))
    turned = turned - [0, 0.1, 0]
    pull = 2.0 * np.stack([turned[:, 1], -turned[:, 0], 0 * turned[:, 0]], axis=1)  # what the mounting adds: + k θ × z
    np.testing.assert_allclose(cable, np.hstack([pull, 0.1 * turned + np.cross([0, 0, R_CG[2]], pull)]), atol=1e-12)
    air, _ = difference(drag=(0.1, 0.2, 0.3), drag_squared=(0.01, 0.0, 0.0))
    expected = omega * [0.1, 0.2, 0.3] + [0.01, 0, 0] * omega * np.abs(omega)
    np.testing.assert_allclose(air[:, 3:], expected, atol=1e-12)
    assert (air[:, 3:] * omega).sum(axis=1).min() >= 0  # what the base does against it is never negative


def test_the_imu_errs_as_declared():
    _, imu = clean()
    seen = lambda **options: imu + difference(**options)[1]  # noqa: E731
    np.testing.assert_allclose(seen(gyro_scale=(0.1, 0, 0))[:, 0], 1.1 * imu[:, 0], atol=1e-12)
    quarter = seen(imu_turn=(0, 0, np.pi / 2))  # its x is the body's y
    np.testing.assert_allclose(quarter, imu[:, [1, 0, 2, 4, 3, 5]] * [1, -1, 1, 1, -1, 1], atol=1e-9)
    np.testing.assert_array_equal(difference(gyro_turn=(0, 0, 0.3))[1][:, 3:], 0)
    matrix = np.arange(9.0).reshape(3, 3) / 100
    np.testing.assert_allclose(difference(gyro_g=matrix)[1][:, :3], imu[:, 3:] @ matrix.T, atol=1e-12)
    np.testing.assert_allclose(difference(gyro_drift=(0, 0.3, 0))[1][[0, -1], 1], [0, 0.3], atol=1e-12)
    np.testing.assert_allclose(seen(accelerometer_scale=(0, 0, 0.1))[:, 5], 1.1 * imu[:, 5], atol=1e-12)
    np.testing.assert_allclose(difference(accelerometer_offset=(1, 2, 3))[1][:, 3:], np.tile([1, 2, 3], (2401, 1)))
    np.testing.assert_allclose(
        difference(imu_position_error=(0.01, 0, 0))[1], difference(imu_position=(0.03, 0.03, -0.04))[1], atol=1e-12
    )


def test_the_load_cell_errs_as_declared():
    wrench, _ = clean()
    t = np.arange(len(wrench)) / RATE
    change = lambda **options: difference(**options)[0]  # noqa: E731
    np.testing.assert_allclose(change(cell_gain=(0.1,) * 6), 0.1 * wrench, atol=1e-12)
    talk = np.zeros((6, 6))
    talk[3, 2] = 1e-3
    np.testing.assert_allclose(change(cross_talk=talk)[:, 3], 1e-3 * wrench[:, 2], atol=1e-12)
    half = wrench + change(cell_turn=(0, 0, np.pi / 4))
    axes = np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    np.testing.assert_allclose(half[:, 3:], wrench[:, 3:] @ axes.T, atol=1e-9)
    np.testing.assert_allclose(change(cell_drift=(1,) * 6), np.outer(t / SHORT, np.ones(6)), atol=1e-12)
    np.testing.assert_allclose(change(gain_drift=(0.1,) * 6), 0.1 * wrench * t[:, None] / SHORT, atol=1e-12)
    np.testing.assert_allclose(
        change(nonlinearity=(0.01,) * 6) / FULL_SCALE, 0.01 * (wrench / FULL_SCALE) ** 2, atol=1e-12
    )
    np.testing.assert_allclose(change(jump=(0, 0, 0, 1, 0, 0))[[0, 1200, 1201, -1], 3], [0, 0, 1, 1], atol=1e-12)
    assert change(hum=(0, 0, 0, 1, 0, 0))[:, 3].std() == pytest.approx(np.sqrt(0.5), rel=0.01)
    before, after = difference(slip=(1e-3, 0, 0))[0][[100, -100]]  # at rest and level at both ends
    np.testing.assert_allclose(before, 0, atol=1e-12)
    np.testing.assert_allclose(after[3:], [0, -1e-3 * MASS * GRAVITY, 0], atol=1e-9)


def test_hysteresis_is_a_loop_of_the_stated_width():
    """Up and down through the full range the branches part by the width, and twice the same path is the same loop."""
    wrench, width = clean()[0], 0.01
    lag = difference(hysteresis=(width,) * 6)[0] / FULL_SCALE
    assert np.abs(lag).max() <= width / 2 + 1e-12
    rising = np.gradient(wrench[:, 3]) > 0
    middle = np.abs(wrench[:, 3] - wrench[0, 3]) < 0.3
    moving = middle & (np.arange(len(wrench)) > 1000) & (np.arange(len(wrench)) < 1500)
    apart = lag[moving & rising, 3].mean() - lag[moving & ~rising, 3].mean()
    assert 0.6 * width < apart < width + 1e-12


def test_time_goes_as_declared():
    """Delay and clock against the run's spline; a filter's delay at the motion's frequencies; stamps by their scatter."""
    _, imu = clean()
    t = np.arange(len(imu)) / RATE
    motion, inner = CubicSpline(t, imu), slice(500, -500)
    for options, instants in (
        ({"imu_delay": 0.0031}, t - 0.0031),
        ({"imu_clock": 1e-3}, 1.001 * t),
        ({"imu_filter": 0.004}, t - 0.004),
    ):
        tolerance = 1e-2 if "imu_filter" in options else 1e-5  # a filter disperses, too
        np.testing.assert_allclose(
            (imu + difference(**options)[1])[inner], motion(instants)[inner], atol=tolerance * 10
        )
    run = measure(4, SILENT, jitter=1e-3)
    assert (run.t_wrench - t).std() == pytest.approx(1e-3, rel=0.1)  # less what stamps that overtake each other swap
    assert (np.diff(run.t_wrench) > 0).all()
    assert not np.array_equal(run.t_wrench, run.t_imu)
    np.testing.assert_array_equal(run.moment, clean()[0][:, 3:])
    for filtered, other in ((0, 1), (1, 0)):
        changed = difference(**{("cell_filter", "imu_filter")[filtered]: 0.002})
        assert np.abs(changed[filtered]).max() > 1e-3
        assert not changed[other].any()


def test_samples_are_lost_and_spoiled_as_declared():
    """Of 12,000 samples in bursts of five, a tenth is lost with a standard error of 0.6 %."""
    run = measure(4, drops=0.1)
    for stamps in (run.t_wrench, run.t_imu):
        assert 1 - len(stamps) / 12001 == pytest.approx(0.1, abs=0.025)
    whole = measure(4)
    np.testing.assert_array_equal(run.moment, whole.moment[np.isin(whole.t_wrench, run.t_wrench)])
    stepped = measure(4, cell_step=(0.5,) * 6, imu_step=(0, 0, 0.01, 0, 0, 0))
    assert np.abs(stepped.moment / 0.5 - np.round(stepped.moment / 0.5)).max() < 1e-9
    assert len(np.unique(stepped.omega[:, 2])) < len(np.unique(stepped.omega[:, 1])) / 5
    spiked = measure(4, spikes=(0, 0, 0, 5, 0, 0)).moment - whole.moment
    assert 10 < (np.abs(spiked[:, 0]) > 4).sum() < 60
    clipped = measure(4, clipped=(0, 0, 0, 0.2, 0, 0)).moment
    assert np.ptp(clipped[:, 0]) == pytest.approx(0.8 * np.ptp(whole.moment[:, 0]))
    vibrating = measure(4, SILENT, vibration=(1.0, 0, 0), shaking=(0, 5.0, 0))
    change = vibrating.acceleration[:300, 0] - measure(4, SILENT).acceleration[:300, 0]
    assert change.std() > 0.65
    assert vibrating.omega[:300, 1].std() == pytest.approx(5 / np.sqrt(2) / (2 * np.pi * 47.3), rel=0.05)


def test_noise_and_constants_are_drawn_by_the_seed():
    """Noise of 2,400 samples to 5 %; constants of 20 seeds, of which the rms has a standard error of 9 %."""
    first, again, other, silent = (
        measure(k, seconds=SHORT, noise=n) for k, n in ((1, 1.0), (1, 1.0), (2, 1.0), (1, 0.0))
    )
    np.testing.assert_array_equal(first.moment, again.moment)
    assert not np.array_equal(first.moment, other.moment)
    for field, name in (("force", "force"), ("moment", "moment"), ("omega", "gyro"), ("acceleration", "accelerometer")):
        noise = getattr(first, field) - getattr(silent, field)
        np.testing.assert_allclose(noise.std(axis=0), NOISE[name], rtol=0.05)
    runs = [measure(seed, seconds=4.0, noise=0.0) for seed in range(20)]
    plain = measure(0, seconds=4.0, noise=0.0, drawn=0.0)
    drawn = np.array([(run.moment - plain.moment)[0] / SIGMA["moment"] for run in runs])
    believed = np.array([(run.r_cg - R_CG) / SIGMA["r_cg"] for run in runs])
    for values in (drawn, believed):
        assert np.sqrt((values**2).mean()) == pytest.approx(1, abs=0.25)
    wrong = measure(1, seconds=SHORT, mass_error=0.1, r_cg_error=(1e-3, 0, 0))
    np.testing.assert_array_equal(wrong.moment, first.moment)
    assert wrong.mass - first.mass == pytest.approx(0.1)
    np.testing.assert_allclose(wrong.r_cg - first.r_cg, [1e-3, 0, 0], atol=1e-15)


def everything(setup, **options):
    """All that is measured or stated, at common instants."""
    run = measure(3, setup, **options)
    grid = np.arange(round(setup.seconds * RATE) + 1) / RATE
    rows = [np.interp(grid, run.t_wrench, x) for x in (*run.force.T, *run.moment.T)]
    rows += [np.interp(grid, run.t_imu, x) for x in (*run.omega.T, *run.acceleration.T)]
    return np.concatenate([[run.mass], run.r_cg, *rows])


@pytest.mark.parametrize("still", [False, True])
def test_every_trouble_grows_with_its_size(still):
    """It changes what is measured or stated; a hundredth of it less, and nothing at all is left of none."""
    setup = Setup(seconds=4.0, still=still, noise=0.0, drawn=0.0)
    plain = everything(setup)
    for name, trouble in TROUBLES.items():
        if bool(trouble.still) != still:
            continue
        part = [everything(setup, **trouble.options(share * trouble.typical, 3)) - plain for share in (0, 0.01, 1)]
        none, small, large = (np.abs(change).sum() for change in part)
        assert none == 0, name
        assert large > 3 * small, name
        assert trouble.typical <= trouble.most


def test_there_are_many_troubles_and_those_with_sources_declare_them():
    assert len(TROUBLES) >= 25
    tables = []
    for name, trouble in TROUBLES.items():
        options = trouble.options(trouble.typical, 1)
        assert set(options) <= set(Setup.__dataclass_fields__), name
        tables += [laboratory_runs.source(*table) for table in trouble.sources(trouble.typical)]
    experiment = Experiment.from_dict(laboratory_runs.document(measure(0, SILENT), sources=tables))
    assert {table["name"] for table in tables} <= {source.name for source in experiment.sources}


def test_a_size_is_scaled_to_a_shift():
    u, missed = np.full(6, 1e-4), TROUBLES["still missed"]
    for name, within in (("gyro scale", 0.05), ("clock", 0.3)):  # in proportion, and not so
        size = size_for(TROUBLES[name], 20.0, u, 1, seconds=8.0)
        assert np.abs(shift(TROUBLES[name], size, 1, seconds=8.0) / u).max() == pytest.approx(20, rel=within)
    still = {"still": True, "seconds": 8.0}
    assert size_for(missed, 3.0, u, 1, **still) == missed.most
    small = size_for(missed, 3.0, u, 1, force_rows=True, **still)
    assert np.abs(shift(missed, small, 1, force_rows=True, **still) / u).max() == pytest.approx(3, rel=0.1)


@pytest.mark.usefixtures("few_draws")
def test_both_routes_bring_the_same_run(tmp_path):
    """Arrays, and a file with its experiment: within rounding of the stamps, the tensor within its interval."""
    run = measure(3, seconds=10.0)
    path = laboratory_runs.write(tmp_path / "run.mcap", run)
    recording = read(path)
    np.testing.assert_allclose(recording.wrench.moment, run.moment)
    np.testing.assert_allclose(recording.imu.linear_acceleration, run.acceleration)
    direct = laboratory_runs.identified(run)
    by_files = laboratory_runs.identified_files(run, tmp_path)
    u = direct.standard_uncertainty
    np.testing.assert_allclose(by_files.inertia, direct.inertia, atol=0.2 * u.min())
    for result in (direct, by_files):
        assert (np.abs(result.inertia - run.truth) < 3 * result.standard_uncertainty).all()
    assert {"r_cg", "gyro_zero"} <= set(by_files.budget)
    still = laboratory_runs.document(measure(0, SILENT, still=True))["recording"]
    lever = laboratory_runs.document(measure(0, SILENT))["recording"]
    assert (still.get("cg_motion"), lever.get("cg_motion")) == ("still", None)
