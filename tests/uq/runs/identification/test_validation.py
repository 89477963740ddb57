"""``inertia identify --validate``: the verdict in terminal, result file and certificate, and the lines of its errors."""

import pytest

from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, write
from tests.helpers.result_schema import contradictions
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.toml_text import toml_text
from uq.report.certificate.certificate import Certificate
from uq.report.report_files import json_text
from uq.runs.identification.identify_files import identify_files

pytestmark = pytest.mark.usefixtures("few_draws", "unjudged")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder, measured = tmp_path_factory.mktemp("validation"), measure(4, seconds=12.0)
    write(folder / "run.mcap", measured)
    (folder / "e.toml").write_text(toml_text(document(measured)))
    return folder


def test_terminal_result_and_certificate_hold_it(folder):
    result = identify_files([folder / "run.mcap"], Experiment.load(folder / "e.toml"), validate=True)
    assert "held out: each half is predicted by the other half as well as noise" in repr(result)
    content = result.to_dict()
    assert contradictions(json_text(content)) == []
    assert content["validation"]["explained"]
    halves = content["validation"]["runs"]
    assert [half["file"] for half in halves] == ["run.mcap, first half", "run.mcap, second half"]
    assert list(halves[0]["rms"]) == ["F1", "F2", "F3", "M1", "M2", "M3"]
    certificate = Certificate(result)
    captions = [table.caption for table in certificate.details()]
    assert "Force and moment predicted, each half by the other" in captions
    axes = certificate.figures()["validation"].axes
    assert [panel.get_title(loc="left") for panel in axes[:3]] == ["F1", "F2", "F3"]
    frame = result.validation.to_frame()
    assert frame["ratio"].between(0.6, 1.5).all()


def test_too_short_a_run_is_a_line(folder, capsys):
    command = ["identify", str(folder / "run.mcap"), "--experiment", str(folder / "e.toml"), "--validate"]
    assert main([*command, "--from", "5", "--to", "6"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: run.mcap, first half is too short to be held out: record for longer")
