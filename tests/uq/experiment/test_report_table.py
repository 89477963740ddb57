"""The table ``[report]``: what it may hold, what it may not claim, and how it meets what a recording says."""

import copy
import json
import re
import tomllib
from datetime import date

import pytest

from tests.helpers.report_tables import FULL, ROOT, T1
from uq.cli.schema import file_schema
from uq.experiment.experiment import Experiment
from uq.experiment.report_table import cautions, parse_report, read
from uq.files.mistakes import ExperimentError


def report(text):
    return parse_report(tomllib.loads(text)["report"])


def test_what_is_stated_is_kept_and_the_rest_is_not_there():
    full = report(FULL)
    assert full.texts["number"] == "2026-0173"
    assert full.performed == (date(2026, 3, 4), date(2026, 3, 5))
    assert full.instruments[0].due == date(2026, 4, 1)
    assert full.approvers == ({"name": "A. Person", "function": "head"},)
    assert full.conformity.limits == {"I11": (0.3, 0.4)}
    empty = report("[report]\ntitle = '  '")
    assert empty.texts == {}
    assert (empty.received, empty.performed, empty.instruments, empty.conformity) == (None, (), (), None)


def test_an_experiment_carries_it_through_json():
    """Dates become strings in result.json, from which the same report is read again."""
    document = tomllib.loads(T1 + FULL)
    experiment = Experiment.from_dict(document)
    inputs = json.loads(json.dumps(experiment.inputs()))
    assert inputs["report"]["received"] == "2026-03-02"
    assert read(inputs) == report(FULL)
    assert read(Experiment.from_dict(inputs["experiment"]).inputs()) == report(FULL)
    assert "report" not in Experiment.from_dict(tomllib.loads(T1)).inputs()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"accreditation": "D-K-1"}, "report.accreditation would claim accreditation"),
        ({"laboratory": {"accredited_by": "X"}}, "report.laboratory.accredited_by would claim accreditation"),
        ({"title": "Accredited certificate"}, "report.title would claim accreditation"),
        ({"instrument": [{"accreditation_mark": "X"}]}, r"report.instrument\[0\].accreditation_mark would claim"),
        ({"colour": "red"}, "unknown key report.colour"),
        ({"item": {"weight": "1 kg"}}, "unknown key report.item.weight"),
        ({"title": 3}, "report.title is 3: write a string"),
        ({"customer": "A"}, "report.customer is 'A': write a table"),
        ({"received": "yesterday"}, "report.received is 'yesterday': write a date"),
        ({"received": 20260302}, "report.received is 20260302: write a date"),
        (
            {"performed": ["2026-03-05", "2026-03-04"]},
            "report.performed is .*: write a date, or the first and the last",
        ),
        ({"performed": ["2026-03-01"] * 3}, "report.performed is .*: write a date, or the first and the last"),
        ({"instrument": {"name": "a"}}, r"report.instrument is a table: write \[\[report.instrument\]\]"),
        ({"instrument": [{"name": "a", "due": "soon"}]}, r"report.instrument\[a\].due is 'soon': write a date"),
        ({"coverage_factor": "2"}, "report.coverage_factor is '2': write a number from 1 to 10"),
        ({"coverage_factor": 0}, "report.coverage_factor is 0: write a number from 1 to 10"),
        ({"coverage_probability": 95}, "report.coverage_probability is 95: write a number from 0.5 to 0.9999"),
        ({"coverage_factor": 2, "coverage_probability": 0.9}, "both coverage_factor and coverage_probability"),
        ({"conditions": {"temperature": 21}}, "report.conditions.temperature is 21: write a string"),
        ({"approved_by": "me"}, "report.approved_by is 'me': write a table"),
        ({"conformity": {"rule": "simple"}}, "missing key report.conformity.specification"),
        ({"conformity": {"specification": "a", "limits": {"I11": ["1 g*m^2", "2 g*m^2"]}}}, "missing key .*rule"),
        ({"conformity": {"specification": "a", "rule": "mild"}}, "choose one of simple, guarded"),
        (
            {"conformity": {"specification": "a", "rule": "simple", "limits": {}}},
            "report.conformity.limits is {}: name one or more of",
        ),
        (
            {"conformity": {"specification": "a", "rule": "simple", "limits": {"I11": ["2 g*m^2", "1 g*m^2"]}}},
            "write the lower limit first",
        ),
        (
            {"conformity": {"specification": "a", "rule": "simple", "limits": {"I11": ["2 g*m^2"]}}},
            "write two values with their units",
        ),
    ],
)
def test_a_mistake_is_one_line(change, words):
    document = tomllib.loads(T1)
    with pytest.raises(ExperimentError, match=words) as caught:
        Experiment.from_dict(document | {"report": change})
    assert "\n" not in str(caught.value)


def inputs(**about):
    return [{"file": "a.mcap", "sha256": "0", **about}]


@pytest.mark.parametrize(
    ("change", "about", "words"),
    [
        ({"instrument": [{"name": "a", "due": "2026-03-03"}]}, {}, "calibration of a was due on 2026-03-03, before"),
        ({"instrument": [{"name": "a", "due": "2026-03-03"}], "performed": []}, {}, "no date of the measurement"),
        ({"instrument": [{"name": "a", "calibrated": "2026-03-06"}]}, {}, "a was calibrated on 2026-03-06, after"),
        ({"instrument": [{"name": "a", "calibrated": "2026-03-01", "due": "2026-02-01"}], "performed": []},
         {"date": "2026-01-09"}, "due on 2026-02-01, before it was calibrated"),
        ({"received": "2026-03-06"}, {}, "the item was received on 2026-03-06, after the measurement of 2026-03-04"),
        ({"issued": "2026-03-04"}, {}, "the report was issued on 2026-03-04, before the measurement of 2026-03-05"),
        ({}, {"date": "2026-03-06"}, "a run was recorded on 2026-03-06, outside report.performed"),
        ({"issued": "2026-03-04", "performed": []}, {"date": "2026-03-06"}, "before the measurement of 2026-03-06"),
        ({}, {"instruments": [{"name": "load_cell", "serial_number": "LC-2"}]}, "serial number LC-1 .* LC-2 in a rec"),
    ],
)  # fmt: skip
def test_dates_and_numbers_that_contradict_are_named(change, about, words):
    table = copy.deepcopy(tomllib.loads(FULL)["report"])
    assert cautions(table, inputs(date="2026-03-04")) == []
    found = cautions(table | change, inputs(**about))
    assert any(re.search(words, text) for text in found), found


def test_a_recording_fills_what_the_table_leaves_open():
    told = {"name": "load_cell", "model": "Cell 9", "serial_number": "LC-1"}, {"name": "imu", "serial_number": "7"}
    about = inputs(date="2026-03-04", instruments=[*told])
    silent = read({"report": {}, "inputs": about * 2})
    assert silent.performed == (date(2026, 3, 4),)
    assert [one.texts for one in silent.instruments] == [*told]
    assert all(one.recorded for one in silent.instruments)
    full = read({"report": tomllib.loads(FULL)["report"], "inputs": about})
    assert [one.recorded for one in full.instruments] == [False, True]
    assert full.instruments[0].texts == told[0] | {"certificate": "K 17"}
    assert full.performed == (date(2026, 3, 4), date(2026, 3, 5))


def test_the_example_of_the_docs_is_a_report():
    page = (ROOT / "docs" / "how-to" / "certificate.md").read_text("utf-8")
    (text,) = re.findall(r"```toml\n(.*?)```", page, flags=re.S)
    example = report(text)
    assert example.conformity.rule == "guarded"
    assert cautions(json.loads(json.dumps(tomllib.loads(text)["report"], default=str)), inputs(date="2026-03-04")) == []
    keys = set(file_schema("experiment")["$defs"]["ReportTable"]["properties"])
    assert not [key for key in keys if not re.search(rf"\b{key}\b", page)]
