"""Plain least squares on a run of MuJoCo without noise gives the payload; coverage is counted."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from identify.motion.serial_arm.joint_series import JointSeries
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.mujoco_run import simulated

pytest.importorskip("mujoco")

from benchmarks.studies.plain_regression import Measured, Stated, coverage_lines, plain

ARM = Path(__file__).parents[3] / "uq" / "examples" / "arm.toml"


@pytest.mark.slow
@pytest.mark.parametrize("lowpass", [None, 20.0])
def test_plain_least_squares_is_right_where_nothing_errs(lowpass):
    """All joints swing for 4 s; differences of samples and the filter err by 3e-3 at most."""
    experiment = Experiment.load(ARM)
    arm, sines = Arm.of(experiment), 0.3 * np.eye(6)
    still, ends = np.zeros((6, 6)), (np.zeros(6), np.full(6, 4.0))
    series = JointSeries(arm.home, np.linspace(0.6, 1.6, 6), still, sines, *ends, np.array(0.5))
    run = simulated(arm, experiment.body, experiment.gravity, series)
    offset = np.array([2.0, -1.0, 1.0, 0.1, 0.2, -0.1])
    log = Measured(run.t, run.joints.position, run.wrench + offset)
    stated = plain(arm, experiment.gravity, log, offsets=True, lowpass=lowpass)
    truth = [2.0, *experiment.body.r_cg_from_q, *experiment.body.inertia]
    np.testing.assert_allclose(stated.values, truth, rtol=5e-3)
    without = plain(arm, experiment.gravity, log, offsets=False, lowpass=lowpass)
    assert np.abs(without.values[1:4] - truth[1:4]).max() > 1e-3


def test_coverage_counts_the_intervals_that_hold_the_truth():
    """Five of twenty errors exceed the half width, in the mass alone."""
    body = Experiment.load(ARM).body
    truth = np.array([2.0, *body.r_cg_from_q, *body.inertia])
    errors = np.zeros((20, 10))
    errors[:, 1:] = np.tile([[0.5], [-0.5]], (10, 9))
    errors[:5, 0], errors[5:, 0] = 2.0, 0.1
    (line,) = coverage_lines(SimpleNamespace(body=body), {"way": Stated(truth + errors, np.ones((20, 10)))})
    assert "covers  97.5 %" in line
    assert "mass 75.0 %" in line
    assert "r_CG 100.0 % (×0.99)" in line
