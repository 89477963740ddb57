"""Findings as warnings of a result: what static poses explain, and where an imported run is cured."""

from dataclasses import replace

import numpy as np
import pytest

from identify.static.centre_result import Centre
from uq.campaign.simulation import simulate
from uq.inspection.experiment_findings import convention_warnings


@pytest.fixture(scope="module")
def run(short):
    simulated = simulate(short, "T1")
    return replace(simulated.run, specific_force=np.asarray(simulated.specific_force))


def centre_of(experiment, force_offset):
    """Static poses that tell this zero of the cell, and the body as it is."""
    r_cg, no_moment = np.asarray(experiment.r_cg_from_q), np.zeros(3)
    return Centre(
        experiment.mass, r_cg, force_offset, no_moment, np.eye(10), np.zeros((6, 6)), 20.0, experiment.gravity
    )


def with_zero(run, experiment, share):
    """A run whose load cell's zero takes a share of the weight away, and what static poses say of it."""
    zero = np.array([0.0, 0.0, -share * experiment.mass * experiment.gravity])
    shifted = replace(run, force=run.force + zero)
    return shifted, centre_of(experiment, zero)


def test_a_zero_that_static_poses_tell_is_no_missing_weight(run, short):
    shifted, zero = with_zero(run, short, 0.6)
    assert "weight" in " ".join(convention_warnings(shifted, short))
    assert convention_warnings(shifted, short, zero=zero) == ()


def test_a_cell_that_was_zeroed_since_the_poses_has_no_finding_of_theirs(run, short):
    _, zero = with_zero(run, short, 0.6)
    assert convention_warnings(run, short, zero=zero) == ()


def test_a_zero_hides_no_reversed_sign(run, short):
    shifted, zero = with_zero(replace(run, force=-run.force, moment=-run.moment), short, 0.05)
    assert 'wrench = "on_sensor"' in " ".join(convention_warnings(shifted, short, zero=zero))


def test_the_cure_of_an_imported_run_is_in_its_map(run, short):
    reversed_run = replace(run, force=-run.force, moment=-run.moment)
    assert "of the map" not in " ".join(convention_warnings(reversed_run, short))
    (text,) = convention_warnings(replace(reversed_run, about={"imported": True}), short)
    assert "in [recording] of the map, on top of what it says, and import the table again" in text
