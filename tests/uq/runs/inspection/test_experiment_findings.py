"""Findings as warnings of a result: what static poses explain, and where an imported run is cured."""

from dataclasses import replace

import numpy as np
import pytest

from identify.estimation.static_poses.centre_result import Centre
from tests.helpers.laboratory import RATE, measure
from tests.helpers.laboratory_files import document
from tests.helpers.laboratory_mechanics import FINE, GRAVITY, base_motion
from tests.helpers.laboratory_runs import run_of
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.inspection.experiment_findings import convention_warnings


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


def test_of_the_channels_of_an_imported_run_no_line_is_told(run, short):
    """A map has ``accelerometer_at_rest``; of an order of channels no line of [recording] is told at all."""
    downwards = replace(run, specific_force=-run.specific_force, about={"imported": True})
    (text,) = convention_warnings(downwards, short)
    assert 'set accelerometer_at_rest = "down" ("up" if that is already set) in [recording] of the map' in text
    swap = np.eye(3)[[1, 0, 2]]
    mirrored = replace(downwards, omega=run.omega @ swap, specific_force=run.specific_force @ swap)
    (text,) = convention_warnings(mirrored, short)
    assert text.endswith(
        "correct order and signs of its channels where they are recorded; no rotation in [recording] can"
    )


WARM = {"warming": (3.0, 0, 0, 0, 0, 0), "seconds": 15.0}


def suspected(setup, removed=0.0):
    """Of a run of the laboratory, whose driver removed the weight of so many kilograms."""
    measured = measure(1, **setup)
    up = GRAVITY * base_motion(measured.setup).up[:: FINE // RATE]
    moment = measured.moment - np.cross(measured.r_cg, removed * up)
    measured = replace(measured, force=measured.force - removed * up, moment=moment)
    return convention_warnings(run_of(measured), Experiment.from_dict(document(measured)))


@pytest.mark.parametrize("time", [40.0, *(pytest.param(time, marks=pytest.mark.slow) for time in (6.0, 180.0))])
@pytest.mark.parametrize("size", [-30.0, 3.0])
def test_a_zero_that_warms_up_is_no_weight_that_a_driver_removed(time, size):
    assert suspected({"warming": (size, 0, 0, 0, 0, 0), "warming_time": time, "seconds": 15.0}) == ()


def test_a_zero_that_warms_up_hides_no_removed_weight():
    (text,) = suspected(WARM, removed=6.0)
    assert "the force is the weight of 13.7 kg, the declared mass is 19.7 kg" in text
    assert "or the driver removed another payload's weight" in text
