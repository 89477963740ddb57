"""What a result assumes of errors: no sentence stands that a declared source makes false."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.small_campaign import campaign, document
from uq.analysis.propagation.law_result import LawResult
from uq.analysis.sensitivity.budget_shares import BudgetResult
from uq.experiment.experiment import Experiment
from uq.plan.measurement.measurement_plan import plan_measurement
from uq.report.assumptions import source_assumptions
from uq.sources.distributions import Empirical, Rectangular, StudentT
from uq.sources.draws import Mixing
from uq.sources.kinds.scale import Scale
from uq.sources.noise_filters import WALK, NoisePart
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import KINDS, ErrorKind, Source

SIGNALS = {"F": "force", "M": "moment", "omega": "gyro"}
OF_SIGNALS = {
    "bias": r"offsets of [^;]*{}[^;]* are zero",
    "coloured": r"noise of [^;]*{}[^;]* neither flicker nor a random walk",
    "drift": r"no drift in [^;]*{}",
    "precision": r"no noise in [^;]*{}",
    "quantisation": r"resolution of [^;]*{}[^;]* is unlimited",
    "saturation": r"range of [^;]*{}[^;]* is unlimited",
    "scale": r"scale factors of [^;]*{}[^;]* are exact",
}
FALSE = {(target, kind): words.format(noun) for kind, words in OF_SIGNALS.items() for target, noun in SIGNALS.items()} | {
    ("displaced_air", "bias"): "no buoyancy",
    ("entrained_air", "bias"): "no air moves along",
    ("gravity", "bias"): "gravity is as stated",
    ("omega", "delay"): "one clock",
    ("omega", "misalignment"): "axes of [^;]*gyro[^;]* are the body's",
    ("r_cg", "bias"): "centre of gravity is exact",
    ("r_cg_from_omb", "bias"): "point that keeps still is as stated",
    ("tilt", "bias"): "starts level",
    ("wrench", "cross_talk"): "no cross-talk",
    ("wrench", "misalignment"): "axes of [^;]*load cell[^;]* are the body's",
}  # fmt: skip
"""Words that are false where such a source is declared, by target and kind."""


def a_source(target, kind, **changed):
    return replace(Source("an_error", target, kind, "rig", np.full(KINDS[target, kind].shape, 0.1)), **changed)


@pytest.fixture(scope="module")
def said():
    """What is assumed of sources, in one text."""
    experiment = Experiment.load("barreto2016")
    return lambda *sources, mixing=(): " ".join(
        source_assumptions(replace(experiment, sources=sources, mixing=mixing).inputs())
    )


def test_the_words_are_those_of_every_kind(said):
    assert set(FALSE) == {pair for pair, kind in KINDS.items() if not isinstance(kind, ErrorByAct)}
    bare = said()
    assert [words for words in FALSE.values() if not re.search(words, bare)] == []
    assert "normal" not in bare


@pytest.mark.parametrize(("target", "kind"), FALSE)
def test_what_is_declared_is_not_assumed_away_and_all_else_is(said, target, kind):
    text = said(a_source(target, kind))
    noise = {(target, "precision")} if kind == "coloured" else set()  # noise with a memory is noise
    gone = {pair for pair, words in FALSE.items() if not re.search(words, text)}
    assert gone == {(target, kind), *noise}


@pytest.mark.parametrize(
    ("changed", "mixing", "words"),
    [
        ({}, (), ["drawn from normal distributions.", "Their mean is zero; they are independent of one another and axis by axis."]),
        ({"shape": Rectangular(-1.0, 1.0)}, (), ["normal distributions, but for an error (rectangular)."]),
        ({"shape": StudentT(0.0, 1.0, 4)}, (), ["normal distributions, but for an error (Student's t)."]),
        ({"mean": np.array([0.0, 0.1, 0.0])}, (), ["mean is zero, but for an error;"]),
        ({}, (Mixing(("an_error",), (3,), 0.5 * np.eye(3) + 0.5),), ["axis by axis, but for an error."]),
        ({"shape": Empirical(np.eye(3))}, (), ["but for an error (from samples).", "axis by axis, but for an error."]),
    ],
)  # fmt: skip
def test_distribution_mean_and_correlation_are_those_declared(said, changed, mixing, words):
    text = said(a_source("F", "bias", **changed), mixing=mixing)
    assert [each for each in words if each not in text] == []


def test_noise_with_a_memory_is_named(said):
    assert "white;" in said(a_source("F", "precision"))
    assert "white, but for an error;" in said(a_source("F", "coloured"))


@pytest.fixture
def kinds():
    """Users' kinds: by the same field of the rig's errors, by another kind's name, and of noise."""
    before = dict(KINDS)

    class Warmed(ErrorKind):
        name, targets, constant, perturbs = "warmed", {"omega": "%"}, True, {"omega": "gyro_scale"}

    class Sagging(ErrorKind):
        name, targets, stage, acts_as = "sagging", {"F": "%"}, 5, (Scale.name,)

    class Humming(ErrorKind):
        name, targets, noise = "humming", {"M": "N*m"}, True

        def noise_parts(self, source, rate):
            return [NoisePart(WALK, np.ones(3))]

    class Rusty(ErrorKind):
        name, targets, constant, absence = "rusty", {"wrench": "N"}, True, "rust does not stiffen the {}"

    yield
    KINDS.clear()
    KINDS.update(before)


@pytest.mark.parametrize(
    ("target", "kind", "gone"),
    [("omega", "warmed", {("omega", "scale")}), ("F", "sagging", {("F", "scale")}),
     ("M", "humming", {("M", "precision"), ("M", "coloured")}), ("wrench", "rusty", set())],
)  # fmt: skip
def test_a_users_kind_takes_back_what_it_makes_false(said, kinds, target, kind, gone):
    text = said(a_source(target, kind))
    assert {pair for pair, words in FALSE.items() if not re.search(words, text)} == gone
    assert ("rust does not stiffen the load cell" in text) == (kind != "rusty")


def test_every_result_of_declared_sources_says_it():
    """A rectangular scale factor of the gyro, its mean known, and correlated biases."""
    content = document()
    content["source"] += [
        {"name": "gyro_scale", "target": "omega", "kind": "scale", "group": "imu", "datasheet": "±1 %", "mean": "0.1 %"}
    ]
    content["correlation"] = [{"sources": ["F_bias", "M_bias"], "coefficient": 0.5}]
    experiment = Experiment.from_dict(content)
    told = experiment.inputs()
    results = [
        replace(campaign("T1"), provenance=told),
        LawResult(np.ones(6), {}, (), lambda: told),
        BudgetResult(4, 0, 2, {}, (), told),
        plan_measurement(experiment, [0.01], goals=["moments"], trajectory="T1", estimator="central"),
    ]
    for result in results:
        text = " ".join(result.section().assumptions)
        assert "but for gyro scale (rectangular)" in text
        assert "mean is zero, but for gyro scale" in text
        assert "but for F bias with M bias" in text
        assert "scale factors of force and moment are exact" in text
