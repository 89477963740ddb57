"""Typical sizes of errors of a rig that nobody has calibrated: standard uncertainties, each with its origin.

One table for the judge's priors and for the conventional bound (``[undeclared]`` of an experiment file). The figures
are known to some 30 to 50 %; docs/how-to/identify.md says what data sheets and studies they are from.
"""

from collections.abc import Mapping

TYPICAL: Mapping[str, float] = {
    "force_gain": 0.0025, "force_gain_by_axis": 0.0025,  # makers of six-axis load cells: 0.5 % in all
    "moment_gain": 0.0025, "moment_gain_by_axis": 0.0025,
    "cross_talk": 0.0015,  # of the largest force and moment
    "load_cell_axes": 0.005,  # bolts without dowels [rad]
    "gyro_scale": 0.003, "gyro_axes": 0.005,  # MEMS gyros of rate grade; a package on a board [rad]
    "delay": 0.001,  # a frame of USB 2.0 [s]
    "mounting_frequency": 50.0,  # hexapods and adapters [Hz]
    "mass": 0.001,  # a shop scale
    "centre_of_gravity": 0.001,  # a drawing [m]
    "gravity": 0.015,  # from the equator to the poles [m/s²]
    "accelerometer_scale": 0.003, "accelerometer_place": 0.002,  # as the gyro; a ruler to the housing [m]
}  # fmt: skip
"""Typical standard uncertainty of each error, by its key in ``[undeclared]``: in SI, relative ones in parts of one."""
