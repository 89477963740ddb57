"""A run or a mounting that does not belong is named, and the pool given without it; of those that belong nothing is said."""

import json
from functools import cache

import numpy as np
import pytest

from identify.results.discordance import discordant_runs
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, identified_files, write
from uq.cli.main import main
from uq.files.toml_text import toml_text
from uq.report.certificate.certificate import Certificate
from uq.report.certificate.tables import discordance

pytestmark = pytest.mark.usefixtures("undrawn", "unjudged")

RANGE = (0.03, 0.03, 0.03)
"""Scale of a gyro that was set to another range [part]: it moves the large moments by 11 g·m²."""


@cache
def run(seed, **trouble):
    """Ten seconds of the one rig: what it draws by the seed is off, but for the noise."""
    return measure(seed, seconds=10, drawn=0, **trouble)


def runs(*, strange=None):
    return [run(seed, **({"gyro_scale": RANGE} if seed == strange else {})) for seed in range(4)]


@pytest.mark.parametrize(
    "method", ["source", pytest.param("gls", marks=pytest.mark.study), pytest.param("joint", marks=pytest.mark.slow)]
)
def test_a_run_that_does_not_belong_is_named_and_the_pool_given_without_it(method, tmp_path):
    result = identified_files(runs(strange=2), tmp_path, method)
    (departure,) = result.discordance.departures
    assert departure.files == ("run2.mcap",)
    at = COMPONENTS.index(departure.component)
    others = identified_files([run(seed) for seed in (0, 1, 3)], tmp_path, method)
    alone = result.runs[2].inertia[at] - others.inertia[at]
    assert departure.difference == pytest.approx(alone, abs=departure.standard_uncertainty)
    without = result.discordance.without
    np.testing.assert_allclose(without.inertia, others.inertia, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(without.interval95, others.interval95, rtol=1e-9, atol=1e-12)
    (line,) = [text for text in result.warnings if "disagrees with the others" in text]
    assert line.startswith(f"run2.mcap disagrees with the others: {departure.component} is ")
    assert others.discordance is None
    assert not [text for text in others.warnings if "disagrees with the others" in text]
    content = result.to_dict()["discordance"]
    assert content["departures"][0]["runs"] == ["run2.mcap"]
    assert (content["with"]["runs"], content["without"]["runs"]) == (4, 3)
    departing, pools = discordance(result)
    assert departing.rows[0][:2] == ["run2.mcap", departure.component]
    assert [row[0] for row in pools.rows] == ["with them: 4 runs", "u", "without them: 3 runs", "u"]
    assert {departing.caption, pools.caption} <= {table.caption for table in Certificate(result).details()}


@pytest.mark.study
def test_terminal_result_and_report_hold_it(tmp_path, capsys):
    several = runs(strange=1)
    paths = [str(write(tmp_path / f"run{k}.mcap", measured)) for k, measured in enumerate(several)]
    (tmp_path / "e.toml").write_text(toml_text(document(several[0])))
    assert main(["identify", *paths, "--experiment", str(tmp_path / "e.toml"), "--out", str(tmp_path / "out")]) == 0
    assert "warning: run1.mcap disagrees with the others: " in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "result.json").read_text())["discordance"]
    assert (content["with"]["runs"], content["without"]["runs"]) == (4, 3)
    assert "The pool with and without the runs that disagree" in (tmp_path / "out" / "report.html").read_text()


def estimate(value, mounting=None, *, alone=True, name="run"):
    """A run's own tensor, uncertain by 1 g·m²."""
    nothing = np.zeros(3)
    return RunEstimate(
        name,
        None,
        1e-3 * np.asarray(value),
        1e-3 * np.ones(6),
        1000,
        100.0,
        nothing,
        0.1,
        None,
        alone,
        mounting=mounting,
    )


def named(estimates, redrawn=0.0):
    return [(d.indices, d.mounting, d.component) for d in discordant_runs(estimates, np.full(6, redrawn))]


def test_a_mounting_leaves_the_others_as_a_whole(generator):
    shift = {"A": 0.0, "B": 60.0, "C": 0.0, "D": 0.0}
    labels = [label for label in shift for _ in range(3)]
    values = [generator.normal(size=6) + [0, 0, 0, shift[label], 0, 0] for label in labels]
    estimates = [estimate(value, label) for value, label in zip(values, labels, strict=True)]
    assert named(estimates) == [((3, 4, 5), "B", "I22")]
    assert named(estimates, redrawn=0.06) == []  # each mounting was expected to differ so much
    halves = [estimate(value, label) for value, label in zip(values[:6], "AAAAAA", strict=True)]
    assert named(halves) == []  # of two halves nobody can say which one leaves


def test_a_run_leaves_the_others_of_its_mounting(generator):
    values = [generator.normal(size=6) + [0, 40.0 * (k == 2), 0, 0, 0, 30.0 * (k > 3)] for k in range(8)]
    estimates = [estimate(value, "AB"[k > 3]) for k, value in enumerate(values)]
    assert named(estimates) == [((2,), None, "I12")]


def test_runs_that_do_not_identify_the_tensor_alone_are_not_judged(generator):
    values = [generator.normal(size=6) + [40.0 * (k == 2), 0, 0, 0, 0, 0] for k in range(5)]
    assert named([estimate(value, alone=k != 2) for k, value in enumerate(values)]) == []
