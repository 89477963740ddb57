"""Errors that an experiment file declares act through the joint estimate."""

import numpy as np

from tests.helpers.laboratory import FULL_SCALE, measure
from tests.helpers.laboratory_files import identified_files, source

SHORT = {"seconds": 15.0}


def test_declared_errors_act_through_the_joint_estimate(tmp_path):
    """They are told apart by their sizes alone."""
    talk = 5e-3 * np.random.default_rng(3).standard_normal((6, 6)) * (1 - np.eye(6))
    measured = measure(
        1, gyro_scale=(3e-3, -4e-3, 2e-3), cell_gain=(4e-3, -6e-3, 2e-3, 5e-3, -3e-3, 6e-3),
        cell_turn=(3e-3, 4e-3, -2e-3), cross_talk=talk * FULL_SCALE[:, None] / FULL_SCALE, **SHORT,
    )  # fmt: skip
    declared = [
        source("g", "omega", "scale", [0.3] * 3), source("f", "F", "scale", [0.5] * 3),
        source("m", "M", "scale", [0.5] * 3), source("a", "wrench", "misalignment", [3e-3] * 3),
        source("c", "wrench", "cross_talk", 5e-3),
    ]  # fmt: skip
    result = identified_files(measured, tmp_path, "joint", declared)
    assert (np.abs(result.inertia - measured.truth) < 3 * result.standard_uncertainty).all()
    total = np.sqrt(sum(row**2 for row in result.contributions.values()))
    assert set(result.contributions) >= {"residuals", *(table["name"] for table in declared)}
    np.testing.assert_allclose(total, result.standard_uncertainty, rtol=1e-6)
    assert np.linalg.eigvalsh(result.parameters.covariance).min() >= -1e-18
