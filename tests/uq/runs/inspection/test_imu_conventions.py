"""A body that is held does not fall, whatever its units."""

import numpy as np
import pytest

from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import in_free_fall
from tests.helpers.spoiled_runs import other_body


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("gyro", "accelerometer"), [(1.0, 1.0), (np.degrees(1.0), 1.0), (1.0, 1 / 9.80665)])
def test_a_body_that_is_held_does_not_fall_whatever_its_units(seed, gyro, accelerometer):
    imu = other_body(seed).imu
    time = (imu.stamp - imu.stamp[0]) * 1e-9
    assert not in_free_fall(ImuSignal(time, gyro * imu.angular_velocity, accelerometer * imu.linear_acceleration))
