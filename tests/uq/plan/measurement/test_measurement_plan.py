"""Which sensor, and how long: the plan's answers, its tables and its files, in Python and by the command."""

import dataclasses
import json
import re

import numpy as np
import pytest

from uq import law
from uq.cli.main import main
from uq.experiment.experiment import Experiment, ExperimentError
from uq.plan.measurement.measurement_plan import plan_measurement
from uq.plan.measurement.required_duration import average, growth_of, lasting
from uq.plan.measurement.sensor_worth import sensor_worth
from uq.report.tables.planning import signed_tenth
from uq.sources.distributions import Normal

pytestmark = pytest.mark.usefixtures("results_follow_their_schema")

FILE = "uq/examples/t1-10s.toml"


@pytest.fixture(scope="module")
def experiment():
    return Experiment.load(FILE)


@pytest.fixture(scope="module")
def plan(experiment):
    return plan_measurement(experiment, [5e-3, 2e-4], goals=("moments",), estimator="smoothed")


def test_the_law_at_the_answer_is_the_target(experiment, plan):
    """Asked apart, at the stated duration; 0.2 % is what the answer promises."""
    reached, forbidden = plan.durations
    longer = {"T1": lasting(experiment.trajectories["T1"], reached.seconds)}
    total = law(dataclasses.replace(experiment, trajectories=longer), "T1", "smoothed")["T1", "smoothed"].total
    assert average(total.three_sigma, "moments") == pytest.approx(5e-3, rel=2e-3)
    assert (forbidden.seconds, forbidden.forbids) == (None, "r_cg")


def test_the_answers_are_sentences(plan):
    now, best, reached, forbidden = plan.title().split("\n")
    assert now == "Average 3σ now (T1 of 10 s, smoothed): 11.4 g·m² (moments) and 7.73 g·m² (products)."
    assert best.startswith("Worth most: M precision. With half of it, 7.09 g·m² (moments, −37.5 %)")
    assert reached.startswith("Average 3σ of 5 g·m² (moments): measure for 45.")
    assert "no duration reaches it" in forbidden
    assert "r cg forbids it" in forbidden


NOTHING = "no [[source]] in the experiment changes its tensor: declare the sensors' errors, or leave out fewer"


@pytest.mark.parametrize("silent", ["none", "of size zero"])
def test_without_a_source_that_counts_there_is_nothing_to_plan(experiment, tmp_path, capsys, silent):
    names = [source.name for source in experiment.sources]
    if silent == "none":
        options = [text for name in names for text in ("--without", name)]
        assert main(["plan", FILE, *options, "--out", str(tmp_path / "out")]) == 2
        assert capsys.readouterr().err == f"error: {NOTHING}\n"
        assert not (tmp_path / "out").exists()
    zero = [dataclasses.replace(source, sigma=0 * source.sigma) for source in experiment.sources]
    sources = () if silent == "none" else tuple(zero)
    for ask in (plan_measurement, sensor_worth, growth_of):
        with pytest.raises(ExperimentError, match=re.escape(NOTHING)):
            ask(dataclasses.replace(experiment, sources=sources, mixing=()))


def test_a_target_that_nobody_asked_for_has_two_digits(experiment):
    """Half of 11.35 and of 7.73 g·m²; all their digits were in the sentence and the table."""
    plan = plan_measurement(experiment, estimator="smoothed")
    assert [row[1] for row in plan.tables()[1].rows] == ["5.7", "3.9"]


def test_what_matters_little_shares_a_row(plan):
    (table,) = plan.overview()
    assert [row[0] for row in table.rows] == ["none", "M precision", "F precision", "r cg", "4 others"]
    assert len(plan.tables()[1].rows) == 2
    assert len(plan.section().details[0].rows) == 8  # the report has all


def test_the_report_leads_with_the_sensor_and_what_cannot_be_reached(plan):
    section = plan.section()
    assert section.verdict.startswith("Worth most: M precision")
    assert [text.split(":")[0] for text in section.findings] == ["Average 3σ of 0.2 g·m² (moments)"]
    assert len(section.computed) == 3  # what is now, what can be reached, how it is computed


def test_half_of_a_noise_that_shrinks_the_estimate_raises_the_uncertainty(experiment):
    """The central difference of a loud gyro: the estimate is 7 % too small, and so are all others' errors in it.

    Without that noise the estimate is larger by 1 / 0.925 in I33, and with it the 3σ that M's noise alone makes.
    """
    sources = tuple(s for s in experiment.sources if s.name in ("omega_precision", "M_precision"))
    worth = plan_measurement(dataclasses.replace(experiment, sources=sources), [1e-2], estimator="central").sensors
    k = worth.sources.index("omega_precision")
    assert worth.changes()[k].max() > 0.005
    assert any(
        "half of omega precision raises the" in text and "every estimate smaller" in text for text in worth.notes()
    )
    quiet = tuple(s if s.name == "M_precision" else dataclasses.replace(s, sigma=0 * s.sigma, shape=Normal(0.0, 1.0))
                  for s in sources)  # fmt: skip
    alone = law(dataclasses.replace(experiment, sources=quiet), "T1", "central")["T1", "central"].total.three_sigma
    assert (alone[5] > worth.halved[k][5]).all()
    assert worth.halved[k][5] > worth.three_sigma[5] * (1 + 1e-3)


@pytest.fixture(scope="module")
def written(tmp_path_factory, experiment):
    """One run of the command, without the noise of force."""
    folder = tmp_path_factory.mktemp("plan") / "out"
    options = ["--target", "5 g*m^2", "--goal", "moments", "--estimator", "smoothed", "--without", "F precision"]
    assert main(["plan", FILE, *options, "--out", str(folder)]) == 0
    return folder


def test_the_command_writes_its_answers(written):
    content = json.loads((written / "result.json").read_text())
    assert content["sensors"]["unit"] == "g*m^2"
    assert content["durations"][0]["unit"] == "kg*m^2"
    assert content["durations"][0]["seconds"] < 45
    assert set(content["sensors"]["sources"]) == {
        "F_bias",
        "M_precision",
        "M_bias",
        "r_cg",
        "omega_precision",
        "omega_bias",
    }
    assert content["provenance"]["left_out"] == ["F_precision"]
    assert content["warnings"] == ["left out, so not in any figure: F precision"]
    page = (written / "report.html").read_text()
    for text in ("Which sensor is worth improving?", "How long must I measure?", "left out, so not in any figure"):
        assert text in page
    assert (written / "durations.svg").exists()


@pytest.mark.parametrize(("value", "text"), [(-0.04, "+0.0"), (-0.06, "−0.1"), (3.94, "+3.9")])
def test_a_change_that_rounds_to_zero_has_no_minus(value, text):
    assert signed_tenth(value) == text


@pytest.mark.parametrize(
    ("options", "message"),
    [(["--target", "5 kg"], "--target"), (["--target", "0 g*m^2"], "give a value above zero"),
     (["--goal", "mass"], "--goal is 'mass': choose one of moments, products, I11"),
     (["--trajectory", "T9"], "unknown trajectory 'T9'"), (["--estimator", "none"], "unknown estimator 'none'")],
)  # fmt: skip
def test_mistakes_are_one_line(options, message, capsys):
    assert main(["plan", FILE, *options]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1


def test_no_platform_is_needed(experiment):
    assert experiment.geometry is None
    assert np.isfinite(plan_measurement(experiment, [5e-3], goals=("I33",), estimator="smoothed").durations[0].seconds)
