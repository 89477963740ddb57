"""Declared errors as unknowns with a prior, the size of a still centre of gravity, and estimates that leave their prior.

The judge is the laboratory of tests/helpers/laboratory.py, which shares no code with the packages.
"""

from dataclasses import replace

import numpy as np
import pytest

from identify.estimation.joint.priors import ConstantError
from identify.results.ledger import Ledger
from identify.signals.run import RunError
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import identified

SHORT = {"seconds": 15.0}


def distances(result, measured):
    """Errors of the six components in standard uncertainties."""
    return (result.inertia - measured.truth) / result.standard_uncertainty


def test_a_missed_still_point_is_estimated_and_no_news_within_its_prior():
    measured = measure(1, still=True, still_miss=(2e-3, -3e-3, 2e-3), **SHORT)
    result = identified(measured, "joint")
    assert np.abs(distances(result, measured)).max() < 3
    assert not result.warnings


def test_a_miss_beyond_its_prior_is_said_first_and_still_right():
    measured = measure(1, still=True, still_miss=(14e-3, 0, 0), **SHORT)
    result = identified(measured, "joint")
    assert result.warnings[0].startswith(
        "the distance of the centre of gravity from the point at rest on axis 1 comes to 14"
    )
    assert np.abs(distances(result, measured)).max() < 3


def test_an_accelerometer_that_contradicts_a_still_centre_of_gravity_stops_the_identification():
    measured = measure(1, still=False, declared_still=True, **SHORT)
    with pytest.raises(RunError, match=r'contradicts cg_motion = "still".* 11\d mm from the point at rest'):
        identified(measured, "joint")


@pytest.mark.study
def test_a_declared_gain_reaches_the_mass():
    """The weight tells the mass within the gain of the force, its moment within r_CG: both together."""
    gain_of_force, of_r = 2.5e-3, 1.5e-4 / 0.053
    measured = measure(2, cell_gain=(gain_of_force, gain_of_force, gain_of_force, 0, 0, 0), still=True, **SHORT)
    common = np.diag(np.repeat([1.0, 0.0], [3, 3])).ravel()
    gain = ConstantError("cell_matrix", np.zeros(36), gain_of_force**2 * np.outer(common, common))
    result = identified(measured, "joint", mass_uncertainty=1.0, errors={"gain": gain})
    both = (gain_of_force**-2 + of_r**-2) ** -0.5
    assert result.mass_uncertainty == pytest.approx(both * measured.mass, rel=0.05)
    assert abs(result.mass - measured.mass) < 2 * result.mass_uncertainty


def test_an_interval_reaches_further_by_an_expected_error(unjudged):
    run = identified(measure(1, **SHORT))
    expected = np.concatenate([np.zeros(4), [1.0, -2.0, 0.0, np.nan, 0.0, 0.0]])
    run, wider = (replace(run, ledger=Ledger(run.ledger.rows, bias)) for bias in (np.zeros(10), expected))
    np.testing.assert_allclose(run.interval95 - wider.interval95, [[1, 0], [0, -2], [0, 0], [0, 0], [0, 0], [0, 0]])


def test_errors_of_one_unknown_add(unjudged):
    measured = measure(1, **SHORT)
    whole = ConstantError("gyro_scale", np.zeros(3), 1e-6 * np.eye(3))
    halves = ConstantError("gyro_scale", np.zeros(3), 0.5e-6 * np.eye(3))
    a, b = (identified(measured, "joint", errors=errors) for errors in ({"a": whole}, {"a": halves, "b": halves}))
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6, atol=1e-14)
