"""The report stands alone, says everything, and is written whole or not at all."""

import json
import re
from importlib import resources
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import pytest

import uq.report.report_files
from identify.display.reporting import Drawing, Section
from identify.display.rounding import finest, with_uncertainty
from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.browser import Reader, drawn
from tests.helpers.driven_browser import needs_chromium
from tests.helpers.small_campaign import TRIALS, campaign, document, lone_trial, paper_result
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import montecarlo
from uq.report.figures.style import DARK
from uq.report.input_tables import inferred
from uq.report.page import inline, joined, json_text
from uq.report.report_files import report, write

HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>'


@pytest.fixture(scope="module", params=[pytest.param("montecarlo", marks=pytest.mark.study), "paper"])
def result(request):
    return campaign() if request.param == "montecarlo" else paper_result()


@pytest.fixture(scope="module")
def html(result):
    return report(result)


def test_page_is_well_formed_and_loads_nothing(html):
    page = Reader(html)
    assert html.startswith("<!DOCTYPE html>")
    assert not {"script", "link", "iframe", "object", "embed", "base", "form"} & set(page.tags)
    assert not page.values("src") + page.values("srcset")
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in page.values("href"))
    assert set(re.findall(r"url\((.)", html)) <= {"#"}
    assert "@import" not in html


def test_every_link_inside_leads_somewhere_and_no_name_stands_twice(html):
    page = Reader(html)
    names = page.values("id")
    assert len(names) == len(set(names))
    targets = [link[1:] for link in page.values("href") if link.startswith("#")] + re.findall(r"url\(#([^)]+)\)", html)
    assert set(targets) <= set(names)


def test_figures_are_drawings_in_the_pages_colours(html):
    """Each said in words, and of a colour for which the dark scheme has another nothing is left."""
    figures = re.findall(r"<svg.*?</svg>", html, flags=re.S)
    assert len(figures) >= 6
    for figure in figures:
        root = ElementTree.fromstring(figure)
        assert root.get("role") == "img"
        assert len(root.get("aria-label")) > 20
    said = " ".join([*figures, *re.findall(r"\.a\d+\{[^}]*\}", html)])
    assert said.count("var(--c") > 20
    assert not set(re.findall(r"#[0-9a-f]{6}\b", said)) & set(DARK)
    assert len(html.encode()) < 350_000  # 620 kB as matplotlib writes styles and coordinates
    declared = re.findall(r"--c([0-9a-f]{6}): light-dark\(#\1, (#[0-9a-f]{6})\)", html)
    assert {f"#{light}": dark for light, dark in declared} == DARK


def test_page_holds_every_figure_beside_its_mean_error(result, html):
    text = Reader(html).text
    dispersions = means = 0
    for of_trajectory in campaign().breakdowns.values():
        for breakdown in of_trajectory.values():
            for s in [*breakdown.groups.values(), *breakdown.sources.values()]:
                places = finest(1e3 * breakdown.total.mean_error_standard_error)
                for k in range(len(COMPONENTS)):
                    mean = 1e3 * s.mean_error[k], 1e3 * s.mean_error_standard_error[k]
                    three_sigma = 1e3 * s.three_sigma[k], 1e3 * s.three_sigma_standard_error[k]
                    assert with_uncertainty(*mean, places) in text
                    assert with_uncertainty(*three_sigma, places) in text
                dispersions, means = dispersions + 1, means + 1
    totals = 8
    assert text.count("3σ") == dispersions + totals
    assert text.count("mean error") == means + totals


def test_page_names_sources_with_references_and_marks_inferred_values():
    preset = Experiment.load("barreto2016").document
    text = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
    rows = inferred(preset)
    assert len(rows) == len(re.findall(r"= .*# INFERRED", text))
    assert ["trajectory.T1.rate", "400 Hz", ""] in rows
    assert ["platform.r_cg_from_omb", "0 m, 0 m, 0.11 m", "g/Ω² = 0.111 m halves the CG effect with a still CG"] in rows
    assert inferred(document()) == []  # another experiment: its values are its own
    page = Reader(report(campaign())).text
    assert "the paper, Table 1: one draw per experiment" in page
    assert "19e-4 rad/s" in " ".join(page)


def test_page_warns_of_mean_errors_beyond_the_dispersion(html):
    findings = html[html.index('<div class="attention"') :].partition("</div>")[0]
    assert "T1, central: the mean error exceeds 3σ: " in findings
    assert "smoothed" not in findings


def test_json_warns_of_the_same_pairs(html):
    """Those of which its own figures have |mean error| > 3σ: the central difference, no other."""
    content = campaign().to_dict()
    beyond = {
        f"{trajectory}, {estimator}"
        for trajectory, estimators in content["trajectories"].items()
        for estimator, breakdown in estimators.items()
        if any(abs(breakdown["groups"]["total"]["mean_error"][c]) > breakdown["groups"]["total"]["three_sigma"][c]
               for c in COMPONENTS)
    }  # fmt: skip
    assert beyond == {f"{name}, central" for name in ("T1", "T2", "T3", "T4")}
    assert {text.partition(":")[0] for text in content["warnings"]} == beyond
    assert paper_result().to_dict()["warnings"] == content["warnings"]
    said = "Biased: central (T1, T2, T3, T4). Unbiased within 3σ: smoothed (T1, T2, T3, T4)."
    assert campaign().section().verdict == said
    assert said in html


def test_a_figure_that_two_results_share_is_shown_once():
    """The first's: the campaign's has standard errors where the law's has none."""
    drawings = [[Drawing(name, which, None) for name in names] for which, names in (("a", "xy"), ("b", "zxw"))]
    sections = [Section("", drawings=some) for some in drawings]
    assert [(d.name, d.caption) for d in joined(*sections).drawings] == [("x", "a"), ("y", "a"), ("z", "b"), ("w", "b")]


def test_what_calls_for_attention_in_another_result_opens_the_verdict():
    """A sign of warning beside a sentence of good news would tell a reader to look for what is wrong with it."""
    sound, doubtful = Section("", verdict="All is well."), Section("", findings=["a mass differs"])
    assert joined(sound).verdict == "All is well."
    said = joined(sound, doubtful).verdict
    assert said == "Read what calls for attention before you use the figures. All is well."


def test_hostile_names_are_text():
    changed = document()
    changed["trajectory"] = {f"../{HOSTILE}": changed["trajectory"]["T1"]}
    changed["source"] = [changed["source"][0] | {"name": HOSTILE, "group": f"{HOSTILE}2", "reference": HOSTILE}]
    changed["recording"] = {}
    changed["estimator"] = [changed["estimator"][0] | {"name": f"a/{HOSTILE}$x$"}]
    result = montecarlo(Experiment.from_dict(changed), trials=4)
    page = Reader(report(result))
    assert "script" not in page.tags
    assert not page.values("onerror")
    assert HOSTILE in page.text
    assert all("/" not in name for name in uq.report.report_files.files(result))


def test_result_json_is_the_result(result, tmp_path):
    write(result, tmp_path)
    assert json.loads((tmp_path / "result.json").read_text("utf-8")) == json.loads(json.dumps(result.to_dict()))
    assert (tmp_path / "report.html").read_text("utf-8") == report(result)
    drawings = {path.stem for path in tmp_path.glob("*.svg")}
    assert len(drawings) >= 6
    assert {path.stem for path in tmp_path.glob("*.png")} == drawings


def test_nan_reaches_neither_json_nor_page(tmp_path):
    write(lone_trial(), tmp_path)
    content = json.loads((tmp_path / "result.json").read_text("utf-8"), parse_constant=pytest.fail)
    total = content["trajectories"]["T1"]["central"]["groups"]["total"]
    assert set(total["three_sigma"].values()) == {None}
    text = Reader((tmp_path / "report.html").read_text("utf-8")).text
    assert not any(re.search(r"\b(nan|inf)\b", cell) for cell in text)


def test_writing_replaces_its_own_files_and_no_others(tmp_path):
    out = tmp_path / "new" / "folder"
    write(campaign("T1"), out)
    (out / "result.json").write_text("old")
    (out / "notes.txt").write_text("mine")
    write(campaign("T1"), out)
    assert json.loads((out / "result.json").read_text("utf-8"))["trials"] == TRIALS
    assert (out / "notes.txt").read_text() == "mine"
    assert not [path for path in out.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("where", ["drawing", "disk"])
def test_a_failure_leaves_nothing_half_written(where, tmp_path, monkeypatch):
    (tmp_path / "result.json").write_text("old")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    if where == "drawing":
        monkeypatch.setattr(uq.report.page, "rendered", fail)
    else:
        monkeypatch.setattr(uq.files.output_folder.os, "fsync", fail)
    with pytest.raises(OSError, match="No space"):
        write(campaign("T1"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["result.json"]
    assert (tmp_path / "result.json").read_text() == "old"


def test_no_report_for_other_things():
    with pytest.raises(TypeError, match="must be a result with a report, but is a dict"):
        report({})


@needs_chromium
def test_a_browser_draws_and_prints_the_page(tmp_path):
    picture, printed, complaints = drawn(report(paper_result()), tmp_path)
    assert complaints == []
    assert matplotlib.image.imread(picture)[..., :3].std() > 0.05  # not a blank page
    assert printed.read_bytes().startswith(b"%PDF")


def test_a_figure_in_a_page_has_short_paths_and_names_of_its_own():
    row = '<path d="M 1 4.004 L 7 4.004 L 7 5 z" clip-path="url(#c)" style="font-family: a; stroke: #404040"/>'
    svg = f'<svg width="9pt" height="9pt"><clipPath id="c"><path d="M 0 0 L 9 9 z"/></clipPath><g id="free">{row}</g></svg>'
    root = ElementTree.fromstring(inline(svg.encode(), 3, "two bars"))
    assert root.find("clipPath").attrib == {"id": "f3-0"}
    assert root.find("g").attrib == {}
    expected = {"d": "M1 4L7 4L7 5z", "clip-path": "url(#f3-0)", "style": "stroke: var(--c404040)"}
    assert root.find("g/path").attrib == expected


def test_a_number_that_is_not_finite_is_null_in_json():
    assert json.loads(json_text({"ratio": np.inf, "rows": (np.nan, 1.0)})) == {"ratio": None, "rows": [None, 1.0]}
