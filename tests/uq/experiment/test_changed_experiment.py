"""Experiments changed in Python: the same as a file with those keys, and messages that name the choices."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from uq.experiment.experiment import Experiment, ExperimentError

EXPERIMENTS = Path(__file__).parents[3] / "uq/examples"


@pytest.fixture(scope="module")
def brief():
    return Experiment.load(EXPERIMENTS / "t1-10s.toml")


@pytest.fixture(scope="module")
def many():
    return Experiment.load(EXPERIMENTS / "many-errors.toml")


def source(experiment, name):
    (of_name,) = (each for each in experiment.sources if each.name == name)
    return of_name


def test_a_changed_experiment_is_a_file_with_those_keys(brief, tmp_path):
    """Oracle: the text of the file, edited by hand."""
    text = (EXPERIMENTS / "t1-10s.toml").read_text("utf-8")
    for old, new in (
        ('["4.3e-4 rad/s", "3.7e-4 rad/s", "19e-4 rad/s"]', '"2e-4 rad/s"'),
        ('mass = "19.7 kg"', 'mass = "21 kg"'),
        ('duration = "10 s"', 'duration = "12 s"'),
        ('band = "2.5 Hz"', 'band = "3 Hz"'),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "edited.toml").write_text(text, "utf-8")
    edited = Experiment.load(tmp_path / "edited.toml")
    changed = brief.with_source("omega_precision", sigma="2e-4 rad/s").with_body(mass="21 kg")
    changed = changed.with_trajectory("T1", duration="12 s").with_estimator("smoothed", band="3 Hz")
    assert changed.inputs()["resolved"] == edited.inputs()["resolved"]
    assert changed.document == edited.document
    assert changed.file == {}  # it is no file's
    assert brief.inputs()["resolved"] == Experiment.load(EXPERIMENTS / "t1-10s.toml").inputs()["resolved"]


def test_sources_are_added_and_left_out(brief):
    more = brief.with_source("cell_scale", target="M", kind="scale", sigma=("1 %", "2 %", "3 %"), group="load_cell")
    np.testing.assert_allclose(source(more, "cell_scale").sigma, [0.01, 0.02, 0.03])
    assert [each.name for each in more.sources] == [*(each.name for each in brief.sources), "cell_scale"]
    less = more.without_source("cell_scale", "F_bias")
    assert {each.name for each in brief.sources} - {each.name for each in less.sources} == {"F_bias"}
    assert less.with_body(mass="20 kg").left_out == ("cell_scale", "F_bias")
    again = less.with_source("F_bias", target="F", kind="bias", sigma="1 N", group="load_cell")
    assert again.left_out == ("cell_scale",)


@pytest.mark.parametrize(
    ("name", "keys", "sigma"),
    [
        ("F_offset", {"sigma": "0.5 N"}, [0.5, 0.5, 0.5]),  # the datasheet and its full scale go
        ("F_offset", {"datasheet": "±1 % FS"}, 2 * np.array([300, 300, 500]) * 0.01 / np.sqrt(3) / 2),  # it stays
        ("gyro_offset", {"sigma": "1 deg/s"}, np.full(3, np.pi / 180)),  # Student's t goes with its scale
        ("gyro_misalignment", {"half_width": "6 deg"}, np.full(3, np.pi / 30 / np.sqrt(6))),  # still triangular
        ("r_cg", {"sigma": ["1 mm", "2 mm", "3 mm"]}, [0.001, 0.002, 0.003]),  # the file of samples goes
        ("delay", {"sigma": "2 ms", "mean": None}, 0.002),
    ],
)
def test_a_width_takes_the_place_of_another(many, name, keys, sigma):
    changed = source(many.with_source(name, **keys), name)
    np.testing.assert_allclose(changed.standard_deviation, sigma, rtol=1e-12)
    if name == "delay":
        assert changed.mean == 0.0


def test_one_figure_of_a_setting_stands_for_all_axes(many):
    assert source(many.with_source("M_range", limit="30 N*m"), "M_range").settings["limit"].tolist() == [30.0] * 3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e.with_source("omega_precison", sigma="1 rad/s"),
         "unknown source 'omega_precison': did you mean omega_precision? choose one of F_precision, F_bias, M_precision, "
         "M_bias, r_cg and 2 more, or give target, kind to add it"),
        (lambda e: e.with_source("F_bias", sigm="1 N"), "unknown key source[F_bias].sigm: did you mean sigma? the keys "
         "here are correlation, datasheet, degrees_of_freedom, distribution and 12 more"),
        (lambda e: e.with_source("F_bias", sigma=1.0),
         "source[F_bias].sigma is 1.0: write three values with their units, one per axis"),
        (lambda e: e.with_body(mas="1 kg"), "unknown key body.mas: did you mean mass? the keys here are inertia, mass, "
         "r_cg_from_q"),
        (lambda e: e.with_trajectory("T9", duration="1 s"),
         "unknown trajectory 'T9': choose one of T1, or give kind to add it"),
        (lambda e: e.with_estimator("smooth", band="1 Hz"), "unknown estimator 'smooth': did you mean smoothed? choose "
         "one of central, smoothed, or give differentiator to add it"),
        (lambda e: e.estimator("smooth"), "unknown estimator 'smooth': did you mean smoothed? choose one of central, "
         "smoothed"),
        (lambda e: dataclasses.replace(e, mass=1.0).with_body(mass="2 kg"),
         "values that no keys state, as after dataclasses.replace: change keys before that"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line_that_names_the_choices(brief, change, message):
    with pytest.raises(ExperimentError, match=f"^{re.escape(message)}$"):
        change(brief)


def test_an_experiment_shows_itself_in_units(brief):
    text = repr(brief)
    assert text.startswith(f"Experiment {EXPERIMENTS / 't1-10s.toml'}\nbody")
    for words in ("19.7 kg", "0, 0, 53 mm", "381.3, 0, 0, 18.5, 0, 379.1 g·m²", "10 s", "400 Hz", "2.5 Hz",
                  "4.3e-4 rad/s, 3.7e-4 rad/s, 19e-4 rad/s"):  # fmt: skip
        assert words in text, words
    assert len(text.splitlines()) < 30
    assert brief._repr_html_().count("<table>") == 4


def test_values_that_are_not_the_files_are_shown_in_si(brief):
    sources = tuple(each.resized(2.0) for each in brief.sources)
    text = repr(dataclasses.replace(brief, sources=sources))
    assert text.startswith(f"Experiment {EXPERIMENTS / 't1-10s.toml'}, changed\n")
    assert "0.000300, 0.000260, 0.000320 m" in text  # twice 0.15, 0.13, 0.16 mm
    assert "0.15 mm" not in text


def test_completion_offers_what_matters(brief):
    offered = set(dir(brief))
    assert {"with_source", "with_body", "sources", "estimator", "tables"} <= offered
    assert not {"title", "notes", "overview", "hidden"} & offered


def test_the_true_motion_is_that_of_mechanics():
    """Specific force less gravity is the acceleration of the centre of gravity: none where it keeps still; alpha is a slope."""
    experiment = Experiment.load(EXPERIMENTS / "t1-10s.toml")
    true = experiment.motion("T1")
    up = np.asarray(true.attitude)[:, 2]
    np.testing.assert_allclose(true.specific_force, experiment.gravity * up, atol=1e-9)
    slope = np.gradient(np.asarray(true.omega), np.asarray(true.t), axis=0)
    np.testing.assert_allclose(slope[1:-1], true.alpha[1:-1], atol=2e-3)
    with pytest.raises(ExperimentError, match="unknown trajectory 'T9'"):
        experiment.motion("T9")
