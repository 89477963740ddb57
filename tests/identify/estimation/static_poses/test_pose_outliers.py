"""Poses that the others contradict, readings that lag behind the load, and rows that are no poses."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.sampled_rows import sampled, turning
from tests.helpers.pose_lab import GRAVITY, KINDS, MASS, TRUTH, directions, lagging, log, signals


def test_a_knock_is_named_with_its_size_and_the_cure_leads_to_the_truth(generator):
    force, moment, f = signals(KINDS["clean, 24 poses"], generator)
    clean = centre(force, moment, f)
    assert clean.warnings == ()
    force[6, 1] += 6.0
    (text,) = centre(force, moment, f).warnings
    size = float(re.search(r"pose 7 contradicts the others: its force y is off by ([0-9.]+) N", text)[1])
    assert size == pytest.approx(6.0, abs=4 * 0.2 * 1.1)
    assert text.endswith("leave it out with --without 7")
    used = np.arange(24) != 6
    without = centre(force, moment, f, used=used)
    assert without.warnings == ()
    alone = centre(force[used], moment[used], f[used])
    np.testing.assert_allclose(without.values, alone.values, rtol=1e-12)
    np.testing.assert_allclose(without.covariance, alone.covariance, rtol=1e-9, atol=1e-20)
    assert (np.abs(without.values - TRUTH) < 4 * without.standard_uncertainty).all()


def test_knocks_that_hide_each_other_are_all_named(generator):
    """Each is within five standard deviations of the others as long as the other two are among them."""
    force, moment, f = signals(KINDS["clean, 24 poses"], generator)
    force[[2, 9, 17], 0] += 3.0
    warnings = centre(force, moment, f, labels=[f"pose {k} (at noon)" for k in range(1, 25)]).warnings
    assert {int(text.split()[1]) for text in warnings} == {3, 10, 18}
    assert "pose 10 (at noon) contradicts" in " ".join(warnings)
    assert "--without 10" in " ".join(warnings)


def plain_mass(force, f):
    """The textbook's least squares of the force, over mass and offset."""
    design = np.vstack([np.hstack([gravity[:, None], np.eye(3)]) for gravity in f])
    return np.linalg.lstsq(design, force.reshape(-1), rcond=None)[0][0]


@pytest.mark.parametrize("memory", [0.0, 0.6])
def test_readings_that_lag_behind_the_load_are_named_and_corrected(generator, memory):
    """Of 1 %, of the pose before or of several; the plain answer is off by several half-widths."""
    f = directions(generator, 24, None)
    wrench = np.hstack([MASS * f, np.cross(TRUTH[1:4], MASS * f)])
    noise = generator.normal(size=(24, 6)) * ([0.05] * 3 + [0.002] * 3)
    read = lagging(0.01, memory)(wrench, generator) + TRUTH[4:] + noise
    result = centre(read[:, :3], read[:, 3:], f)
    half = np.ptp(result.interval95, axis=1) / 2
    assert "the readings lag behind the load: " in result.warnings[0]
    assert (np.abs(result.values - TRUTH) < 2 * half).all()
    assert abs(plain_mass(read[:, :3], f) - MASS) > 4 * half[0]


def test_poses_that_tilt_all_ways_are_not_told_to_tilt_further(generator):
    """One axis of the moment ten times as noisy: the centre is known unevenly, by no fault of the poses."""
    force, moment, f = signals(KINDS["clean, 24 poses"], generator)
    result = centre(force, moment + generator.normal(size=moment.shape) * [0.0, 0.0, 0.2], f)
    _, along = result.directions
    assert along[2] > 5 * along[0]
    assert result.warnings == ()


@pytest.mark.parametrize(("rate", "noise"), [(125.0, 0.0), (50.0, 0.0), (125.0, 2e-3), (1000.0, 1e-2)])
def test_samples_of_a_motion_are_told_from_poses(generator, rate, noise):
    assert sampled(GRAVITY * log(generator, rate=rate, noise=noise))


def test_poses_are_no_samples_of_a_motion(generator):
    """At random, each read thirty times, an even raster of 5°, some within 3°, one attitude with noise."""
    unit = directions(generator, 200, None)
    raster = [
        Rotation.from_euler("xy", [a, b], degrees=True).as_matrix()[2] for a in range(0, 90, 5) for b in range(0, 90, 5)
    ]
    repeated = np.repeat(unit[:20], 30, axis=0) + 0.02 * generator.normal(size=(600, 3))
    near = np.repeat(directions(generator, 60, 0.03), 10, axis=0)
    rest = np.array([0, 0, GRAVITY]) + 0.02 * generator.normal(size=(5000, 3))
    for rows in (unit, np.array(raster), np.repeat(unit[:20], 30, axis=0), repeated, near, rest):
        assert not sampled(rows)


def test_the_turning_of_a_direction_is_its_angular_velocity():
    """A direction that is fixed in space turns backwards in a body that turns by 0.5 rad/s about an axis across it."""
    omega, t = np.array([0.3, 0.4, 0.0]), np.arange(400) / 100.0
    up = Rotation.from_rotvec(np.outer(t, omega)).inv().apply([0.0, 0.0, GRAVITY])
    across = omega - up * (up @ omega)[:, None] / GRAVITY**2
    np.testing.assert_allclose(turning(up, 100.0)[50:-50], across[50:-50], rtol=0.02, atol=5e-3)
