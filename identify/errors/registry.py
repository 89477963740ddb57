"""All errors of the rig: one line an error."""

from collections.abc import Mapping

from identify.errors.body.centre_of_gravity import CENTRE_OF_GRAVITY
from identify.errors.body.mass import MASS
from identify.errors.body.moving_part import MOVING_PART
from identify.errors.body.slip import SLIP
from identify.errors.body.still_point import STILL_POINT
from identify.errors.error_model import ErrorModel
from identify.errors.imu.accelerometer_axes import ACCELEROMETER_AXES
from identify.errors.imu.accelerometer_bias import ACCELEROMETER_BIAS
from identify.errors.imu.accelerometer_delay import ACCELEROMETER_DELAY
from identify.errors.imu.accelerometer_place import ACCELEROMETER_PLACE
from identify.errors.imu.accelerometer_scale import ACCELEROMETER_SCALE
from identify.errors.imu.clock import CLOCK
from identify.errors.imu.delay import DELAY
from identify.errors.imu.gyro_axes import GYRO_AXES
from identify.errors.imu.gyro_bias import GYRO_BIAS
from identify.errors.imu.gyro_drift import GYRO_DRIFT
from identify.errors.imu.gyro_g import GYRO_G
from identify.errors.imu.gyro_late import GYRO_LATE
from identify.errors.imu.gyro_scale import GYRO_SCALE
from identify.errors.imu.imu_axes import IMU_AXES
from identify.errors.imu.tilt import TILT
from identify.errors.load_cell.cross_talk import CROSS_TALK
from identify.errors.load_cell.drift import DRIFT
from identify.errors.load_cell.filter import FILTER
from identify.errors.load_cell.gain import FORCE_GAIN, FORCE_GAIN_BY_AXIS, GAIN, MOMENT_GAIN, MOMENT_GAIN_BY_AXIS
from identify.errors.load_cell.gain_drift import GAIN_DRIFT
from identify.errors.load_cell.jump import JUMP
from identify.errors.load_cell.load_cell_axes import LOAD_CELL_AXES
from identify.errors.load_cell.nonlinearity import NONLINEARITY
from identify.errors.load_cell.warming import WARMING
from identify.errors.load_cell.zero import ZERO
from identify.errors.rig.air import AIR
from identify.errors.rig.cable import CABLE
from identify.errors.rig.gravity import GRAVITY
from identify.errors.rig.mounting import MOUNTING
from identify.errors.rig.weight import WEIGHT

ERRORS: Mapping[str, ErrorModel] = {
    error.name: error for error in (
        FORCE_GAIN, FORCE_GAIN_BY_AXIS, MOMENT_GAIN, MOMENT_GAIN_BY_AXIS, GAIN, CROSS_TALK, LOAD_CELL_AXES,
        NONLINEARITY, GAIN_DRIFT, FILTER, ZERO, DRIFT, WARMING, JUMP,
        GYRO_SCALE, GYRO_AXES, GYRO_BIAS, GYRO_DRIFT, GYRO_G, GYRO_LATE, DELAY, CLOCK, IMU_AXES, TILT,
        MASS, CENTRE_OF_GRAVITY, STILL_POINT, SLIP, MOVING_PART,
        GRAVITY, MOUNTING, CABLE, AIR, WEIGHT,
        ACCELEROMETER_SCALE, ACCELEROMETER_AXES, ACCELEROMETER_PLACE, ACCELEROMETER_DELAY, ACCELEROMETER_BIAS,
    )
}  # fmt: skip
"""Every error by its name, in the order of reports and of ``[undeclared]``."""
