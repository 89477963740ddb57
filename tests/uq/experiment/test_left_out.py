"""An experiment without some of its sources, by name or kind."""

import json

import numpy as np
import pytest

from uq.analysis.propagation.uncovered_sources import BeyondLawError
from uq.cli.main import main
from uq.cli.terminal.sources import shares_named
from uq.experiment.experiment import Experiment, ExperimentError
from uq.experiment.experiment_tables import left_out_note

MANY = "uq/examples/many-errors.toml"


@pytest.fixture(scope="module")
def many():
    return Experiment.load(MANY)


def test_names_and_kinds_are_left_out_and_remembered(many):
    reduced = many.without_source("coloured", "F resolution", "M_range")
    gone = {"F_flicker", "gyro_noise", "F_resolution", "M_range"}
    assert {s.name for s in many.sources} - {s.name for s in reduced.sources} == gone
    assert set(reduced.left_out) == gone
    assert left_out_note(reduced.left_out) == [
        "left out, so not in any figure: F flicker, gyro noise, F resolution, M range"
    ]
    assert (many.without_source(), left_out_note(many.left_out)) == (many, [])


def test_a_result_says_what_was_left_out_and_of_which_file(many):
    inputs = many.without_source("drift").inputs()
    assert inputs["left_out"] == ["M_drift", "gyro_drift"]
    assert inputs["experiment_file"] == many.inputs()["experiment_file"]
    assert {s["name"] for s in inputs["experiment"]["source"]} == {s.name for s in many.sources} - {
        "M_drift",
        "gyro_drift",
    }


def test_a_correlation_goes_with_either_of_its_sources(many):
    """F_scale and M_scale are correlated; M_noise's own axes stay so."""
    reduced = many.without_source("F_scale")
    assert [mix.names for mix in reduced.mixing] == [("M_noise",)]
    assert {mix.names for mix in many.mixing} == {("M_noise",), ("F_scale", "M_scale")}


def test_what_stays_draws_what_it_drew(many):
    before = {source.name: source for source in many.sources}
    for source in many.without_source("coloured").sources:
        np.testing.assert_array_equal(source.sigma, before[source.name].sigma)


def test_an_unknown_name_is_one_line_with_the_choices(many, capsys):
    with pytest.raises(
        ExperimentError, match=r"'flicker': choose a name of \[\[source\]\] \(F_noise, .*more\) or a kind"
    ):
        many.without_source("flicker")
    for command in ("montecarlo", "plan", "design"):
        assert main([command, MANY, "--without", "flicker"]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1, command
        assert "no source to leave out has the name or kind 'flicker'" in line


def test_shares_are_told_where_a_monte_carlo_of_the_file_is_in_the_folder(many, tmp_path):
    """12 % of each component alone, of another file nothing."""

    def refused(folder):
        with pytest.raises(BeyondLawError) as error, shares_named(many, folder):
            raise BeyondLawError({"F_flicker": "is noise that is not white"})
        return str(error.value)

    def written(sha256):
        widths = {"groups": {"total": {"three_sigma": {"I11": 2.0, "I22": 4.0}}},
                  "sources": {"F_flicker": {"three_sigma": {"I11": 0.24, "I22": 0.48}}}}  # fmt: skip
        content = {"provenance": {"experiment_file": {"sha256": sha256}}, "trajectories": {"T1": {"central": widths}}}
        (tmp_path / "result.json").write_text(json.dumps(content))

    assert "%" not in refused(tmp_path)
    written("0" * 64)
    assert "%" not in refused(tmp_path)
    written(many.file["sha256"])
    assert "'F_flicker' is noise that is not white (alone 12 % of the 3σ); leave out (" in refused(tmp_path)
    assert "%" not in refused(None)
