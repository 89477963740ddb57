"""What tests/helpers/laboratory.py measured, as arrays for ``identify``."""

from dataclasses import replace

import numpy as np

from identify.estimation.joint.priors import Alignment
from identify.identification import identify
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from tests.helpers.laboratory import SIGMA, Measured
from tests.helpers.laboratory_mechanics import GRAVITY

BAND = 3.0
"""That holds the motion but for 0.2 % of its power, products of its three angles [Hz]: a smoother of it costs no bias."""


def run_of(measured: Measured, name="laboratory"):
    """The run as arrays bring it to ``identify``."""
    run = Run.from_channels(
        measured.t_wrench, measured.force, measured.moment, measured.t_imu, measured.omega, name=name,
        specific_force=measured.acceleration,
    )  # fmt: skip
    return replace(run, imu_position=np.array(measured.setup.imu_position))


def identified(measured, method="source", **options):
    """The tensor by ``identify``: one run or several of one body, all that is stated of the first."""
    several = measured if isinstance(measured, (list, tuple)) else [measured]
    first = several[0]
    stated = {
        "r_cg": first.r_cg, "sigma_r_cg": SIGMA["r_cg"], "mass": first.mass, "gravity": GRAVITY,
        "cg_motion": "still" if first.declared_still else None,
        "estimator": EstimatorSpec("smoothed", "savitzky-golay", BAND),
        "alignment": Alignment(sigma_gyro_bias=SIGMA["gyro"], sigma_accelerometer_bias=SIGMA["accelerometer"]),
    }  # fmt: skip
    return identify([run_of(each, f"run {k}") for k, each in enumerate(several)], method=method, **(stated | options))
