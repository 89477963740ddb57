"""A fixture taken off: whose coverage factor widens which part of the interval, what both have in common."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from identify.exceptions import RunError
from identify.identification import identify
from identify.results.covariances import check_covariances
from identify.results.ledger import Ledger, tensor_row
from identify.rigid_body.inertia import pack
from identify.rigid_body.inertial_parameters import InertialParameters
from tests.helpers import posed_runs
from tests.helpers.changed_result import changed, not_judged, typical, with_typical
from tests.helpers.tare_lab import ALIGNMENT, BODY, FIXTURE, GRAVITY, SMOOTHED, WHOLE, experiment_of, measured
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.campaign.simulation import simulate
from uq.report.certificate.certificate import Certificate
from uq.report.input_tables import input_table
from uq.runs.identification import tare
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.tare import tare_files, tared


def half_width(result):
    return np.diff(result.interval95, axis=1)[:, 0] / 2


def test_each_part_of_the_interval_has_its_own_coverage_factor(brief, generator, unjudged):
    """U² = k_w² V_w + k_f² V_f: with the fixture's intervals doubled its part counts four times; 10 %, as parameters mix."""
    whole, _ = measured(experiment_of(brief, WHOLE), WHOLE, generator, np.zeros(3), 0)
    fixture, _ = measured(experiment_of(brief, FIXTURE), FIXTURE, generator, np.zeros(3), 1)
    own = tuple(dataclasses.replace(row, key="") for row in fixture.ledger.rows)
    fixture = dataclasses.replace(fixture, ledger=Ledger(own, fixture.ledger.expected))
    middle = fixture.inertia[:, None]
    doubled = changed(fixture, interval95=middle + 2 * (fixture.interval95 - middle))
    exact = InertialParameters(
        fixture.parameters.mass, fixture.parameters.r_cg, fixture.parameters.inertia, np.zeros((10, 10))
    )
    of_whole = half_width(tared(whole, exact)) ** 2
    of_fixture = half_width(tared(whole, fixture)) ** 2 - of_whole
    assert (of_fixture > 0).all()
    np.testing.assert_allclose(half_width(tared(whole, doubled)) ** 2 - of_whole, 4 * of_fixture, rtol=0.1)


@pytest.fixture(scope="module")
def by_joint(brief):
    """Body with its fixture, and fixture, by the joint estimate; the centre of the first."""
    generator = np.random.default_rng(4)
    misaligned = ALIGNMENT * generator.normal(size=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("identify.identification.judged", not_judged)
        whole, centre = measured(experiment_of(brief, WHOLE), WHOLE, generator, misaligned, 0, "joint")
        fixture, _ = measured(experiment_of(brief, FIXTURE), FIXTURE, generator, misaligned, 1, "joint")
    return whole, fixture, centre


def test_with_joint_the_covariance_of_the_body_is_one_and_holds_the_truth(by_joint):
    whole, fixture, _ = by_joint
    (in_whole,), (in_fixture,) = (
        [row for row in each.ledger.rows if row.key == "attitude axis"] for each in (whole, fixture)
    )
    assert in_whole.changes.shape == in_fixture.changes.shape == (10, 3)
    body = tared(whole, fixture)
    ten = body.parameters
    u = ten.standard_uncertainty
    assert np.isfinite(u).all()
    assert np.linalg.eigvalsh(ten.covariance / np.outer(u, u)).min() > -1e-9
    assert (np.abs(ten.values - BODY.values) < 3.5 * u).all()
    assert (np.diff(body.interval95, axis=1) > 0).all()


def test_what_lasts_acts_through_the_joint_estimate(by_joint, brief, unjudged):
    """The centre shifted by what an axis of the attitudes does to it, and the run identified anew."""
    whole, _, centre = by_joint
    run = simulate(experiment_of(brief, WHOLE), "T1", trial=0).run
    effect, times = next(iter(centre.lasting_errors.values())), 10
    (row,) = (row for row in whole.ledger.rows if row.key == "attitude axis")
    shift = times * effect
    moved = dataclasses.replace(
        centre, mass=centre.mass + shift[0], r_cg=centre.r_cg + shift[1:4],
        force_offset=centre.force_offset + shift[4:7], moment_offset=centre.moment_offset + shift[7:],
    )  # fmt: skip
    other = identify(run, centre=moved, estimator=SMOOTHED, method="joint", cg_motion="still", gravity=GRAVITY)
    u = whole.parameters.standard_uncertainty
    change = (other.parameters.values - whole.parameters.values) / u
    np.testing.assert_allclose(times * row.changes[:, 0] / u, change, atol=0.1)
    assert np.abs(change).max() > 1


def test_a_covariance_that_is_none_is_refused_in_one_line(by_joint):
    """That of the ten parameters, a sum of squares, can only be not finite; that of an alignment can be any."""
    whole, _, _ = by_joint
    endless = tensor_row("endless", np.diag(np.where(np.arange(6) == 4, 1e200, 0.0)))
    with (
        np.errstate(over="ignore"),
        pytest.raises(RunError, match=r"covariance of mass, centre .* is not finite \(I23\): check the declared"),
    ):
        check_covariances(whole.joined([endless]))
    turned = dataclasses.replace(whole.rotation, covariance=np.diag([1.0, 1, 1]) + 3 * np.eye(3)[::-1])
    with pytest.raises(RunError, match=r"the rotation is not positive semidefinite .* or use the method source"):
        check_covariances(whole.joined(rotation=turned))


def test_the_method_reaches_the_tare(monkeypatch, by_joint, brief):
    whole, fixture, _ = by_joint
    fixture = dataclasses.replace(fixture, runs=(dataclasses.replace(fixture.runs[0], sha256="of the empty"),))
    asked = {}
    monkeypatch.setattr(tare, "identify_files", lambda *_, **options: asked.update(options) or fixture)
    stated = dataclasses.replace(brief, fixture=dataclasses.replace(FIXTURE, inertia=np.full(6, np.nan)))
    tare.tare_files(whole, ["empty.mcap"], stated, method="joint")
    assert asked["method"] == "joint"


def test_the_certificate_names_the_files_of_the_tare(by_joint):
    whole, fixture, _ = by_joint
    files = {"inputs": [{"file": "empty.mcap", "sha256": "ab"}], "centre": {"file": "empty.json", "sha256": "cd"}}
    of_whole = {"inputs": [{"file": "body.mcap", "sha256": "ef"}]}
    result = tared(dataclasses.replace(whole, provenance=of_whole), dataclasses.replace(fixture, provenance=files))
    rows = input_table(Certificate(result).section().provenance).rows
    assert sorted(rows) == [("body.mcap", "ef"), ("empty.json", "cd"), ("empty.mcap", "ab")]


def test_what_nobody_declared_is_the_same_in_tare_and_body(by_joint):
    """A gain of the whole wrench common to both: the body's tensor errs in proportion to itself, as if weighed alone."""
    loaded, empty, _ = by_joint
    gain = 0.01

    def gained(result):
        ten = result.parameters.values
        changes = gain * np.concatenate([ten[:1], np.zeros(3), ten[4:]])
        return typical("gain", changes[:, None])

    late = typical("delay", 1e-3 * np.eye(10)[:, 5:6])
    body = tared(with_typical(loaded, [gained(loaded)]), with_typical(empty, [gained(empty), late]))
    both, alone = body.undeclared.rows
    expected = gain * np.concatenate([[body.mass], np.zeros(3), body.inertia])
    np.testing.assert_allclose(both.changes[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(alone.changes[5, 0], -1e-3, rtol=1e-9)
    assert tared(with_typical(loaded, None), empty).undeclared is None


GRIPPER = (0.9, np.array([0.0, 0.0, 0.057]), np.diag([2.8e-3, 3.1e-3, 0.6e-3]))
"""Mass, centre of gravity from Q and tensor about it of a gripper."""


def with_gripper(run, *, empty):
    """The wrench of a gripper, alone or beside the payload of a clean run on an arm."""
    mass, r_cg, tensor = GRIPPER
    alpha = np.gradient(run.omega, run.t, axis=0)
    force = mass * (run.specific_force + np.cross(alpha, r_cg) + np.cross(run.omega, np.cross(run.omega, r_cg)))
    moment = alpha @ tensor + np.cross(run.omega, run.omega @ tensor) + np.cross(r_cg, force)
    other = (posed_runs.ZERO[:3], posed_runs.ZERO[3:]) if empty else (run.force, run.moment)
    return replace(run, force=force + other[0], moment=moment + other[1])


def test_a_gripper_is_taken_off_by_its_own_motion(tmp_path):
    """By the method joint its mass and centre of gravity are those of its run, with their covariance."""
    experiment = posed_runs.experiment(tmp_path, "imu", sigma_delay="0 s", sigma_rotation="0 deg")
    experiment = replace(experiment, r_cg_from_q=None, sources=())
    runs = [posed_runs.measured(seed, seconds=12.0, noise=0.1) for seed in (3, 4)]
    paths = [
        posed_runs.write(tmp_path / name, with_gripper(run, empty=empty), "imu", "mcap")
        for name, run, empty in zip(("both", "gripper"), runs, (False, True), strict=True)
    ]
    both = identify_files(paths[0], experiment)
    assert both.mass == pytest.approx(posed_runs.MASS + GRIPPER[0], abs=2e-3)
    body = tare_files(both, [paths[1]], experiment)
    assert abs(body.mass - posed_runs.MASS) < 4 * body.mass_uncertainty < 8e-3
    np.testing.assert_allclose(body.r_cg, posed_runs.R_CG, atol=5e-4)
    np.testing.assert_allclose(body.inertia, pack(posed_runs.TENSOR), atol=2e-4)
    with pytest.raises(ExperimentError, match="or record accelerations and use the method joint"):
        tare_files(both, [paths[1]], experiment, method="source")
