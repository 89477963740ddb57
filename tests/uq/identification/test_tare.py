"""A fixture taken off: whose coverage factor widens which part of the interval."""

import dataclasses

import numpy as np

from identify.rigid_body.inertial_parameters import InertialParameters
from tests.tare_lab import FIXTURE, WHOLE, experiment_of, measured
from uq.identification.tare import tared


def half_width(result):
    return np.diff(result.interval95, axis=1)[:, 0] / 2


def test_each_part_of_the_interval_has_its_own_coverage_factor(brief, generator):
    """U² = k_w² V_w + k_f² V_f: with the fixture's intervals doubled its part counts four times."""
    whole, _ = measured(experiment_of(brief, WHOLE), WHOLE, generator, np.zeros(3), 0)
    fixture, _ = measured(experiment_of(brief, FIXTURE), FIXTURE, generator, np.zeros(3), 1)
    middle = fixture.inertia[:, None]
    doubled = dataclasses.replace(fixture, interval95=middle + 2 * (fixture.interval95 - middle))
    exact = InertialParameters(
        fixture.parameters.mass, fixture.parameters.r_cg, fixture.parameters.inertia, np.zeros((10, 10))
    )
    of_whole = half_width(tared(whole, exact)) ** 2
    of_fixture = half_width(tared(whole, fixture)) ** 2 - of_whole
    assert (of_fixture > 0).all()
    np.testing.assert_allclose(half_width(tared(whole, doubled)) ** 2 - of_whole, 4 * of_fixture, rtol=1e-6)
