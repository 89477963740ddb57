"""The law's numbers for a page: sums of parts against the law itself, as the page's own script computes them."""

import dataclasses
import json

import numpy as np
import pytest

from tests.helpers.adjustable_lab import widget_page
from tests.helpers.driven_browser import Browser, needs_chromium
from tests.helpers.law_sources import LINKED, SOURCES
from tests.helpers.source_lab import experiment, source
from uq.analysis.propagation.adjustable_law import LEVELS, contributions_of, described
from uq.analysis.propagation.experiment_law import law, prepare_law
from uq.analysis.propagation.inputs import constants_of

NAMES = (
    "F_noise",
    "M_noise",
    "M_rounding",
    "gyro_noise",
    "M_drift",
    "F_scale",
    "M_scale",
    "gyro_turn",
    "delay",
    "tilt",
    "air",
)


@pytest.fixture(scope="module")
def several():
    """Eleven kinds of source, two of them correlated, two with expectations; the smoothed derivative alone."""
    given = experiment(*(s for s in SOURCES if s["name"] in NAMES), correlations=LINKED)
    return dataclasses.replace(given, estimators=given.estimators[1:])


FULL_SCALE = ["300 N", "4500 N", "500 N"]
OWN = [
    (("F", "bias", {"datasheet": "±1 % of full scale", "full_scale": FULL_SCALE}), "datasheet", 1.0, "% of full scale"),
    (("F", "bias", {"datasheet": ["accuracy ±2 N", "accuracy ±4 N", "±1 N"]}), "datasheet", 4.0, "N"),
    (("F", "bias", {"datasheet": "3 sigma = 7.5 N"}), "datasheet", 7.5, "N, 3 sigma"),
    (("F", "bias", {"distribution": "rectangular", "half_width": ["1 N", "3 N", "2 N"]}), "half-width", 3.0, "N"),
    (("omega", "misalignment", {"sigma": ["0.1 deg", "0.2 deg", "0.05 deg"]}), "σ", 0.2, "deg"),
    (("r_cg", "bias", {"sigma": "0.15 mm"}), "σ", 0.15, "mm"),
    (("F", "bias", {"distribution": "student_t", "scale": "0.4 N", "degrees_of_freedom": 9}), "scale", 0.4, "N"),
    (("F", "quantisation", {"step": "0.1 N"}), "step", 0.1, "N"),
]


@pytest.mark.parametrize(("declared", "what", "figure", "unit"), OWN, ids=[str(case[0][2]) for case in OWN])
def test_a_page_shows_the_figure_as_it_was_declared(declared, what, figure, unit):
    """Of the largest axis, in the words and the unit of the file; not the standard deviation that follows from it."""
    target, kind, keys = declared
    given = experiment(source("e", target, kind, **keys))
    (shown,) = described(given)
    assert (shown["what"], shown["figure"], shown["unit"]) == (what, figure, unit)
    larger = dataclasses.replace(given, sources=tuple(s.resized(2.0) for s in given.sources))
    assert described(larger)[0]["what"] in ("σ", "step")  # no file says it any more


def test_parts_add_up_to_the_law(several):
    """Exactly at the stated figures, but for joint effects that are too small to be told."""
    prepared = prepare_law(several)
    parts = contributions_of(several, prepared.runs["T"], constants_of(several.sources, several.mixing), 100.0)
    at = list(LEVELS).index(1.0)
    share = parts.gyro[:, None]
    assert [s.name for s, part in zip(several.sources, parts.gyro, strict=True) if part] == ["gyro_noise"]
    assert len(parts.joint) > 0
    for k, estimator in enumerate(prepared.estimators):
        total = prepared.evaluate()["T", estimator].total
        each = parts.first[k, at] + parts.second[k, at] + share * parts.gyro_variance[k, at]
        joint = sum(beyond[k] for _, _, beyond in parts.joint)
        variance = np.diag(total.covariance)
        np.testing.assert_allclose(each.sum(axis=0) + joint[:2].sum(axis=0), variance, rtol=1e-3)
        means = parts.expected[k] + parts.mean[k, at] + share * parts.gyro_mean[k, at]
        mean = means.sum(axis=0) + joint[2] + parts.rest[k]
        np.testing.assert_allclose(mean, total.mean_error, atol=1e-3 * np.sqrt(variance.min()))


def test_a_part_is_what_a_source_does_alone(brief):
    """Where no noise of the gyro dilutes, a millionth of its variance: against the law of each source alone."""
    prepared = prepare_law(brief, "T3", "central")
    constants = constants_of(brief.sources, brief.mixing)
    parts = contributions_of(brief, prepared.runs["T3"], constants, brief.trajectories["T3"].rate, np.array([1e-6]))
    alone = prepared.evaluate()["T3", "central"].sources
    for i, s in enumerate(brief.sources):
        if s.name != "omega_precision":
            variance = parts.first[0, 0, i] + parts.second[0, 0, i]
            np.testing.assert_allclose(3 * np.sqrt(variance), alone[s.name].three_sigma, rtol=1e-3, atol=1e-8)


@needs_chromium
@pytest.mark.parametrize("which", ["several", pytest.param("brief", marks=pytest.mark.study)])
def test_the_script_agrees_with_the_law_at_other_figures(which, request, tmp_path, generator):
    """Fifteen times other figures, from a fifth to five times: 3σ within 2 %, means within 2 % of 3σ and of themselves."""
    given = request.getfixturevalue(which)
    result = law(given, None if which == "several" else "T3")
    factors = 5.0 ** generator.uniform(-1, 1, (15, len(given.sources)))
    factors[0], factors[1, :3] = 1.0, 0.0
    with Browser(tmp_path, widget_page(result.adjustable())) as browser:
        for factor in factors:
            resized = [s.resized(f) for s, f in zip(given.sources, factor, strict=True)]
            other = law(
                dataclasses.replace(given, sources=tuple(resized), document={}), [pair[0] for pair in result.pairs()]
            )
            for k, pair in enumerate(result.pairs()):
                state = json.dumps({"pair": k, "factors": factor.tolist(), "duration": 1, "amplitude": 1})
                told = browser.run(f"evaluate(model.get('law'), {state}).total")
                spread, mean = (np.array([part[name] for part in told]) / 1e3 for name in ("spread", "mean"))
                exact = other[pair].total
                np.testing.assert_allclose(spread, exact.three_sigma, rtol=2e-2)
                allowed = 2e-2 * (np.abs(exact.mean_error) + exact.three_sigma)
                assert (np.abs(mean - exact.mean_error) <= allowed).all(), (pair, factor)


def test_figures_have_units_one_can_type():
    given = experiment(
        source("a", "r_cg_from_omb", "bias", sigma=["1 mm", "2 mm", "1 mm"]),
        source("b", "F", "scale", sigma=["0.3 %"] * 3),
        source("c", "M", "quantisation", step=["0.001 N*m"] * 3),
        source("d", "F", "coloured", white="0.004 N*s**0.5"),
        source("e", "M", "coloured", flicker="0 N*m"),
    )
    told = law(given, "T", "central").adjustable()["sources"]
    assert [(of["what"], of["figure"], of["unit"]) for of in told] == [
        ("σ", 2.0, "mm"),
        ("σ", 0.3, "%"),
        ("step", 0.001, "N·m"),
        ("white", 0.004, "N·s^½"),
        ("flicker", 0.0, "N·m"),
    ]
