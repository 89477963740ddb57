"""An IMU by itself: in free fall its units and axes are not judged; under gravity wrong ones are named (test_inspect)."""

import numpy as np

from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import accelerometer_axes, in_free_fall, wrong_units
from tests.helpers import wrist_runs
from tests.helpers.thrown_bodies import throw


def test_of_thrown_bodies_nothing_is_said():
    """Fifteen, whose specific force is steady, or turns, or happens to be of the size of g, in one unit or another."""
    for seed in range(15):
        imu = throw(seed)
        assert wrong_units(imu) == {}, seed
        assert accelerometer_axes(imu) is None, seed


def test_a_body_at_rest_does_not_fall():
    still = np.zeros((1000, 3))
    for size in (9.81, 1.0):
        assert not in_free_fall(ImuSignal(np.arange(1000) / 200, still, still + [0.0, 0.0, size]))


def test_a_gyro_in_degrees_on_an_arm_that_accelerates_is_named():
    """The accelerometer stands 0.3 m off: a fifth of what it reads is not gravity, which makes it turn more, not less."""
    t, _, _, omega, specific = wrist_runs.signals()
    alpha, lever = np.gradient(omega, t, axis=0), np.array([0.3, 0, 0])
    read = specific + np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
    size = np.linalg.norm(read, axis=1)
    assert np.median(np.abs(size - np.median(size))) > 0.05 * np.median(size)
    assert "deg/s" in wrong_units(ImuSignal(t, np.degrees(omega), read))
    assert wrong_units(ImuSignal(t, omega, read)) == {}
