"""The laboratory's sensors err, and its runs reach the packages, as declared."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from rig.runs import read
from tests.helpers import laboratory_files, laboratory_runs
from tests.helpers.laboratory import FULL_SCALE, NOISE, RATE, SIGMA, Setup, measure
from tests.helpers.laboratory_mechanics import (
    FINE,
    GRAVITY,
    MASS,
    R_CG,
    base_motion,
)

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


@pytest.mark.usefixtures("few_draws")
def test_both_routes_bring_the_same_run(tmp_path):
    """Arrays, and a file with its experiment: within rounding of the stamps, the tensor within its interval."""
    run = measure(3, seconds=10.0)
    path = laboratory_files.write(tmp_path / "run.mcap", run)
    recording = read(path)
    np.testing.assert_allclose(recording.wrench.moment, run.moment)
    np.testing.assert_allclose(recording.imu.linear_acceleration, run.acceleration)
    direct = laboratory_runs.identified(run)
    by_files = laboratory_files.identified_files(run, tmp_path)
    u = direct.standard_uncertainty
    np.testing.assert_allclose(by_files.inertia, direct.inertia, atol=0.2 * u.min())
    for result in (direct, by_files):
        assert (np.abs(result.inertia - run.truth) < 3 * result.standard_uncertainty).all()
    assert {"r_cg", "gyro_zero"} <= set(by_files.contributions)
    still = laboratory_files.document(measure(0, SILENT, still=True))["recording"]
    lever = laboratory_files.document(measure(0, SILENT))["recording"]
    assert (still.get("cg_motion"), lever.get("cg_motion")) == ("still", None)
