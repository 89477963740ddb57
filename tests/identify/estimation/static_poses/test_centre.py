"""Mass, centre of gravity and offsets from static poses, against closed forms; poses that cannot be used are refused."""

import numpy as np
import pytest

from identify.estimation.static_poses.accelerometer import calibrate
from identify.estimation.static_poses.centre import centre
from identify.signals.run import RunError
from tests.helpers.pose_lab import GRAVITY, R_CG, TRUTH, directions, wrench_of


def test_exact_poses_give_the_exact_parameters(generator):
    f = directions(generator, 5, None)
    found = centre(*wrench_of(f), f)
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-12, atol=1e-13)
    assert found.poses == 5
    assert found.gravity == pytest.approx(GRAVITY)


def test_the_stated_covariance_is_that_of_repeated_experiments(generator):
    """150 draws of 12 poses: every normalised deviation has the variance of Student's t, and so has the whole.

    A noise level from 10 to 30 degrees of freedom makes it 1.07 to 1.25; the variance of 150 draws has a standard error
    of 15 %, so that 4 of them are 0.6; the mean of 150 distances, of ten squares each, one of 3 %.
    """
    f = directions(generator, 12, None)
    force, moment = wrench_of(f)
    deviations, distances = [], []
    for _ in range(150):
        noisy = force + 0.3 * generator.normal(size=f.shape), moment + 0.004 * generator.normal(size=f.shape)
        found = centre(*noisy, f)
        error = found.values - TRUTH
        deviations.append(error / found.standard_uncertainty)
        distances.append(error @ np.linalg.solve(found.covariance, error))
    assert (np.abs(np.var(deviations, axis=0) - 1.15) < 0.1 + 4 * 0.15).all(), np.var(deviations, axis=0)
    assert np.mean(distances) == pytest.approx(10 * 1.2, abs=5 * np.sqrt(2 * 10 / 150) + 0.5)


def test_an_accelerometers_offset_and_gain_are_found(generator):
    f = directions(generator, 15, None)
    offset = np.array([0.8, -0.3, 0.1])
    found = calibrate(1.02 * f + offset, GRAVITY)
    assert found.fitted
    np.testing.assert_allclose(found.offset, offset, atol=1e-9)
    assert found.gain == pytest.approx(1.02)
    np.testing.assert_allclose(found.specific_force(1.02 * f + offset, GRAVITY), f, atol=1e-9)


def test_flat_poses_do_not_tell_an_accelerometers_offset(generator):
    angle = np.linspace(0, 0.05, 8)
    flat = GRAVITY * np.stack([np.sin(angle), np.sin(2 * angle) / 2, np.ones(8)], axis=1)
    assert not calibrate(flat, GRAVITY).fitted
    with pytest.raises(RunError, match="do not determine the accelerometer's offset"):
        calibrate(flat, GRAVITY, method="offset")
    with pytest.raises(RunError, match="reads zero at pose 3"):
        calibrate(np.where(np.arange(8)[:, None] == 2, 0.0, flat), GRAVITY)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda F, M, f: (-F, -M, f), "points along gravity .*correct recording.wrench"),
        (lambda F, M, f: (F[:2], M[:2], f[:2]), "2 poses in the poses: give three or more"),
        (lambda F, M, f: (F, M, np.tile(f[:1], (6, 1))), "too much alike"),
        (lambda F, M, f: (F, M[:4], f), r"moment of the poses has shape \(4, 3\)"),
        (lambda F, M, f: (np.where(F[4, 1] == F, np.nan, F), M, f), "force of the poses is not finite at pose 5"),
        (lambda F, M, f: (np.where(F[4, 1] == F, 1e200, F), M, f), r"force in the poses is 1\.0e\+200 .*remove such"),
    ],
)
def test_poses_that_cannot_be_used(generator, change, words):
    f = directions(generator, 6, None)
    with pytest.raises(RunError, match=words) as error:
        centre(*change(*wrench_of(f), f))
    assert "\n" not in str(error.value)


def test_poses_about_one_axis_are_refused_and_about_two_are_not():
    """Turned about the level x axis alone, the CG's x is not seen: no moment depends on it but the offset."""
    angle = np.linspace(0, 1.0, 8)
    about_one = GRAVITY * np.stack([0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    found = centre(*wrench_of(about_one), about_one)  # a plane of directions: two differences that are not parallel
    np.testing.assert_allclose(found.r_cg, R_CG, rtol=1e-9)
    line = about_one[:1] + np.outer(np.linspace(0, 1, 5), [0.0, 0.5, -0.3])
    with pytest.raises(RunError, match="too much alike"):
        centre(*wrench_of(line), line)
