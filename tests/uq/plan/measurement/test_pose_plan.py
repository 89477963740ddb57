"""Designed static poses: the exchange against every set, the promise against simulated poses, the list as it is run."""

import dataclasses
import json
from itertools import combinations_with_replacement

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre, predicted_covariance
from identify.estimation.static_poses.pose_design import best_poses, log_determinant
from identify.estimation.static_poses.pose_fit import Attitudes
from uq.cli.main import main
from uq.experiment.experiment import Experiment, ExperimentError
from uq.experiment.platform_table import LimitsTable
from uq.files.schema import declared_table
from uq.files.toml_text import toml_text
from uq.plan.measurement.pose_plan import COLUMNS, DECLARATION, plan_poses

pytestmark = pytest.mark.usefixtures("results_follow_their_schema")

MASS, R_CG, G = 19.7, np.array([0.01, -0.02, 0.053]), 9.81
NOISE = np.array([0.2, 0.2, 0.4, 0.015, 0.02, 0.02])
LIMITS = {"length": ["0.55 m", "0.64 m"], "force": "120 N"}


def leaning(tilt, azimuths):
    """Specific force of poses that lean by one angle towards each azimuth."""
    return G * np.array([[-np.sin(tilt) * np.cos(a), -np.sin(tilt) * np.sin(a), np.cos(tilt)] for a in azimuths])


def simulated(force, generator, attitudes=None):
    """Mean force and moment of poses."""
    noise = NOISE * generator.normal(size=(len(force), 6))
    F = MASS * force + [5.0, -2.0, 1.0] + noise[:, :3]
    return F, np.cross(R_CG, MASS * force) + [0.1, 0.2, -0.3] + noise[:, 3:]


@pytest.fixture(scope="module")
def experiment(preset):
    document = dict(preset.document)
    document["platform"] = {**document["platform"], "geometry": "assumed-source-size", "limits": LIMITS}
    document["poses"] = dict(DECLARATION)
    return Experiment.from_dict(document)


@pytest.fixture(scope="module")
def limits():
    return declared_table("limits", LIMITS, LimitsTable).limits.figures


@pytest.fixture(scope="module")
def plan(experiment, limits):
    return plan_poses(experiment, experiment.trajectories["T1"], limits, count=6, starts=1)


def test_the_promise_is_the_scatter_of_many_series():
    """150 series of eight poses: a standard deviation has 5.8 % standard error, ten of them within four: 6e-4."""
    generator = np.random.default_rng(3)
    force = np.concatenate([leaning(0.2, np.arange(6)), leaning(0.1, [1.0, 3.0])])
    promised = np.sqrt(np.diag(predicted_covariance(force, MASS, R_CG, np.diag(NOISE**2))))
    values = []
    for _ in range(150):
        result = centre(*simulated(force, generator), force)
        values.append([result.mass, *result.r_cg, *result.force_offset, *result.moment_offset])
    np.testing.assert_allclose(np.std(values, axis=0), promised, rtol=0.232)


def test_declared_attitudes_are_in_the_promise():
    force = leaning(0.2, np.arange(6))
    quiet, each, common = (
        predicted_covariance(force, MASS, R_CG, np.diag(NOISE**2), attitudes)
        for attitudes in (
            Attitudes(),
            Attitudes(0.01),
            Attitudes(0.0, np.cross(np.eye(3), force[:, None]).swapaxes(1, 2)),
        )
    )
    assert (np.diag(each) > np.diag(quiet)).all()
    assert common[1, 1] > quiet[1, 1]


def test_exchange_finds_the_best_of_all_sets():
    """All 330 sets of four out of eight poses; the exchange must find the best of them."""
    generator = np.random.default_rng(1)
    force = np.concatenate([leaning(t, [a]) for t, a in generator.uniform(0, [0.3, 7.0], (8, 2))])

    def cost(chosen):
        return log_determinant(force[np.asarray(chosen)], MASS, R_CG, np.diag(NOISE**2))

    best = min(map(cost, combinations_with_replacement(range(8), 4)))
    assert cost(best_poses(8, 4, cost)) == pytest.approx(best, abs=1e-9)


def test_poses_on_a_line_tell_nothing():
    assert log_determinant(leaning(0.2, [0.0, 0.0, np.pi]), MASS, R_CG, np.diag(NOISE**2)) == np.inf
    with pytest.raises(ValueError, match="no 3 of 2 poses determine"):
        best_poses(2, 3, lambda chosen: np.inf)


def test_the_plan_beats_the_naive_poses(plan):
    designed, naive = plan.standard_uncertainty, plan.naive_standard_uncertainty
    assert (designed[:4] < naive[:4]).all()
    assert designed[:4].prod() < 0.4 * naive[:4].prod()


def test_equal_poses_are_told(plan):
    """Of twelve planned poses and of the same with the first three times."""
    position, rotation = (np.concatenate([each[:1], each[:1], each]) for each in (plan.position, plan.rotation))
    repeated = dataclasses.replace(
        plan, position=position, rotation=rotation, length=np.resize(plan.length, (len(position), 6))
    )
    assert [1, 2, 3] in [numbers[:3] for numbers in repeated.repeats()]
    (note,) = repeated.notes()
    assert note.startswith("note: poses 1, 2")
    assert " are the same: " in note
    distinct = np.unique(np.round(np.hstack([plan.position, plan.rotation.reshape(-1, 9)]), 9), axis=0)
    assert len(plan.position) - len(distinct) == sum(len(numbers) - 1 for numbers in plan.repeats())


def test_the_plan_is_within_the_limits_and_uses_them(plan, limits):
    low, high = limits.length.T
    assert (plan.length >= low - 1e-9).all()
    assert (plan.length <= high + 1e-9).all()
    room = np.minimum(plan.length - low, high - plan.length).min(axis=1)
    assert room.min() < 2e-3
    assert plan.tilt.max() <= plan.reach.max() + 1e-9


def test_what_is_written_is_the_plan(plan, experiment):
    head, *lines = plan.csv().split()
    assert tuple(head.split(",")) == COLUMNS
    rows = np.array([[float(cell) for cell in line.split(",")[:16]] for line in lines])
    turn = Rotation.from_euler("ZYX", rows[:, 6:3:-1])
    np.testing.assert_allclose(turn.inv().apply([0, 0, -1]), rows[:, 13:16], atol=1e-8)
    ends = np.asarray(experiment.platform.home) + rows[:, None, 1:4] + np.stack(
        [turn.apply(p) for p in np.array(experiment.platform.joints)], axis=1
    )  # fmt: skip
    np.testing.assert_allclose(
        np.linalg.norm(ends - np.asarray(experiment.platform.base), axis=2), rows[:, 7:13], atol=1e-8
    )


def filled(plan, generator):
    """The list with force and moment as the platform would measure them."""
    head, *lines = plan.csv().split()
    force, moment = simulated(G * plan.rotation[:, 2], generator)
    cells = [
        ",".join([*line.split(",")[:16], *map(str, (*f, *m))]) for line, f, m in zip(lines, force, moment, strict=True)
    ]
    return "\n".join([head, *cells, ""])


def test_the_list_is_read_by_the_command_that_finds_the_centre(plan, experiment, tmp_path, capsys):
    (tmp_path / "e.toml").write_text(toml_text(experiment.document))
    (tmp_path / "poses.csv").write_text(plan.csv())
    command = ["centre", str(tmp_path / "poses.csv"), "--experiment", str(tmp_path / "e.toml"), "--out", str(tmp_path)]
    assert main(command) == 2
    assert "column 'fx' in poses.csv is empty or NaN at row 2" in capsys.readouterr().err
    (tmp_path / "poses.csv").write_text(filled(plan, np.random.default_rng(5)))
    assert main(command) == 0
    content = json.loads((tmp_path / "centre.json").read_text())
    assert abs(content["mass"]["value"] - MASS) < 5 * 0.2
    np.testing.assert_allclose(content["cg"]["value"], R_CG, atol=5e-3)


@pytest.mark.parametrize(
    ("given", "message"),
    [({"count": 2}, "2 static poses: ask for three or more"), ({"hold": 0.0}, "held for 0 s")],
)
def test_bad_plans(experiment, limits, given, message):
    with pytest.raises(ExperimentError, match=message):
        plan_poses(experiment, experiment.trajectories["T1"], limits, **given)


def test_a_cell_without_noise_and_a_platform_too_weak(experiment, limits):
    spec = experiment.trajectories["T1"]
    quiet = dataclasses.replace(experiment, sources=(), document={})
    with pytest.raises(ExperimentError, match="no noise of force and moment"):
        plan_poses(quiet, spec, limits)
    weak = limits._replace(force=np.full(6, 10.0))
    with pytest.raises(ExperimentError, match="cannot stand at home with the body: force of leg"):
        plan_poses(experiment, spec, weak)
