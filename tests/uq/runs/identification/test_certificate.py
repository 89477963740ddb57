"""The certificate: its figures against closed forms, what stands on it, and how it prints."""

import copy
import dataclasses
import json
import re
import subprocess
import tomllib
from statistics import NormalDist

import jax
import numpy as np
import pytest

from identify import omega_r
from identify.display.rounding import concise
from identify.estimation.joint.prior_departure import declaration
from identify.least_squares.admissible_tensor import Admissible
from identify.least_squares.pooling import NORMAL
from identify.results import measured_directions
from identify.results.alignment import Aligned
from identify.results.ledger import Ledger, tensor_row
from identify.rigid_body.inertial_parameters import InertialParameters
from tests.helpers.browser import Reader, drawn
from tests.helpers.changed_result import changed, typical, with_typical
from tests.helpers.driven_browser import needs_chromium, needs_font, needs_poppler
from tests.helpers.report_tables import FULL, T1
from uq.experiment.conformity import Conformity, decide
from uq.experiment.experiment import Experiment
from uq.experiment.report_table import Report
from uq.monte_carlo.campaign.simulation import simulate
from uq.monte_carlo.coverage.expanded_uncertainty import of_tensor
from uq.report.certificate import checks
from uq.report.certificate.certificate import Certificate
from uq.report.certificate.front import number_of
from uq.report.certificate.tables import alignment, bodies, budget, mass_and_centre
from uq.report.input_tables import input_table
from uq.report.report_files import files
from uq.report.report_files import report as page
from uq.report.tables.identification import run_table
from uq.runs.identification import identify_files as identify_module
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.tare import tared


def report(result):
    """The certificate's page."""
    return page(Certificate(result))


HOSTILE = 'A"} </style><script>alert(1)</script>\\'


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    experiment = Experiment.from_dict(tomllib.loads(T1))
    for seed in (0, 1):
        simulate(experiment, seed=seed).write(folder / f"run-{seed}.mcap")
    (folder / "experiment.toml").write_text(T1 + FULL, "utf-8")
    return folder


@pytest.fixture(scope="module")
def plain(runs):
    return identify_files(sorted(runs.glob("*.mcap")), Experiment.from_dict(tomllib.loads(T1)))


@pytest.fixture(scope="module")
def full(runs):
    return identify_files(sorted(runs.glob("*.mcap")), Experiment.load(runs / "experiment.toml"))


def declared(result, part=0.0):
    """The result as if all errors were declared, but for one that has this part of u in each of the ten parameters."""
    added = part * np.nan_to_num(result.parameters.standard_uncertainty)
    rows = [typical("gyro_scale", added[:, None], "scale of the gyro", "0.3 %")] if part else []
    return with_typical(result, rows)


def reported(result, **table):
    """The result as if its experiment had this table [report]."""
    return dataclasses.replace(result, provenance={**result.provenance, "report": table})


def test_expanded_uncertainty_keeps_the_results_intervals_or_scales_them(plain):
    usual = of_tensor(plain)
    np.testing.assert_allclose(usual.interval, plain.interval95, rtol=1e-12)
    np.testing.assert_allclose(usual.factor * usual.standard, usual.expanded, rtol=1e-12)
    wide = of_tensor(plain, probability=0.99)
    assert (wide.expanded > usual.expanded).all()
    two = of_tensor(plain, factor=2.0)
    np.testing.assert_allclose(two.expanded, 2 * plain.standard_uncertainty, rtol=1e-9)
    same = of_tensor(plain, factor=float(usual.factor[0]))
    assert same.probability[0] == pytest.approx(0.95, abs=1e-6)
    skewed = changed(plain, interval95=plain.interval95 + 1e-3)
    assert all("+" in row[2] and "−" in row[2] for row in of_tensor(skewed).rows(1e3))


@pytest.mark.usefixtures("blank_pictures")
def test_what_is_not_determined_is_not_figured_but_does_not_fail(plain):
    """A component that nothing bounds above, and one of which nothing is known."""
    interval, determined = plain.interval95.copy(), np.arange(6) % 2 == 0
    interval[3], interval[1], interval[5] = (1e-3, np.inf), (-np.inf, np.inf), (-np.inf, np.inf)
    why = Admissible(plain.inertia, interval, determined, plain.inertia, plain.interval95, "data too weak", 0.0)
    kept = np.concatenate([np.ones(4), determined])[:, None]
    rows = [row.changed(kept) for row in plain.ledger.rows]
    nothing = tensor_row("possible bodies", np.diag(np.where(determined, 0.0, np.nan)))
    ledger = Ledger((*rows, nothing), np.where(kept[:, 0] > 0, plain.ledger.expected, np.nan))
    weak = dataclasses.replace(plain, ledger=ledger, admissible=why)
    rows = of_tensor(weak).rows(1e3)
    assert rows[1][1:] == [rows[1][1], "–", "–", "–", "–", "–", "−∞ … ∞"]
    assert rows[3][-1] == "1.000 … ∞"
    assert rows[0][:2] == of_tensor(plain).rows(1e3)[0][:2]
    for rule in ("simple", "guarded"):
        (one,) = decide(Conformity(specification="a", rule=rule, limits={"I22": (0.0, 1.0)}), weak.inertia, weak.standard_uncertainty,
                        of_tensor(weak).expanded)  # fmt: skip
        assert one.outcome == "undecided"
    (table,) = bodies(weak)
    assert [row[3] for row in table.rows] == ["yes", "no"] * 3
    assert table.rows[0][1] == of_tensor(plain).rows(1e3)[0][1]
    text = Reader(report(reported(weak, coverage_factor=2))).text
    assert "not determined about every axis" in " ".join(text)
    assert not {"nan", "inf"} & set(" ".join(text).split())


def test_uncertainty_about_an_axis_is_that_of_the_turned_tensor(plain):
    about = measured_directions.uncertainty_about(plain.covariance)
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(6), plain.covariance, 4000, method="cholesky")
    matrices = draws[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    for k in (0, 300, 999):
        axis = about.directions[k]
        scatter = np.einsum("i,kij,j->k", axis, matrices, axis).std()
        assert about.values[k] == pytest.approx(scatter, rel=0.045)  # 4 standard errors of a deviation from 4,000 draws
    assert about.largest[1] >= np.sqrt(np.diag(plain.covariance)[[0, 3, 5]]).max() * 0.999


def test_contributions_add_up_to_the_variance(plain):
    squares = sum(np.square(part) for part in plain.contributions.values())
    np.testing.assert_allclose(squares, np.diag(plain.covariance), rtol=0.02)  # 10,000 draws of each source


@pytest.mark.usefixtures("blank_pictures")
def test_a_fixture_that_was_taken_off_has_its_table_and_its_part(plain):
    fixture = InertialParameters(
        2.0, np.array([0.0, 0.0, 0.01]), np.diag([5e-3, 5e-3, 9e-3])[np.triu_indices(3)],
        np.diag([1e-3, *[1e-4] * 3, *[5e-5] * 6]) ** 2,
    )  # fmt: skip
    body = tared(plain, fixture)
    text = " ".join(Reader(report(body)).text)
    assert "Tare: mass, centre of gravity from Q, tensor" in text
    assert "fixture taken off" in text
    squares = sum(np.square(part) for part in body.contributions.values())
    np.testing.assert_allclose(squares, np.diag(body.covariance), rtol=0.02)
    (table,) = budget(body)
    types = {row[0]: row[1] for row in table.rows}
    assert (types["residuals"], types["fixture taken off"], types["combined"]) == ("A", "A, B", "")
    assert set(types.values()) == {"A", "B", "A, B", ""}
    shown = np.array([float(cell.replace("−", "-")) for cell in run_table(body).rows[0][4:]])
    off = 1e3 * (plain.inertia - body.inertia)
    assert off[0] > 5
    np.testing.assert_allclose(shown, 1e3 * plain.runs[0].inertia - off, atol=0.051)  # rounded to a tenth


def test_mass_and_centre_of_gravity_have_intervals_of_their_own(plain):
    """k = 2.5 of the mass, as few poses give it, 1.96 of the rest; with k = 2 asked for, twice u."""
    result = changed(declared(plain), mass=19.7, mass_uncertainty=0.01, sigma_r_cg=np.full(3, 2e-4))
    half = np.array([2.5, *[NORMAL] * 3]) * result.parameters.standard_uncertainty[:4]
    four = result.value[:4, None] + half[:, None] * [-1, 1]
    result = changed(result, intervals95=np.vstack([four, plain.interval95]))
    result = dataclasses.replace(result, centre_from="static poses")
    rows = mass_and_centre(result, Report()).rows
    assert rows[0] == ["mass, kg", "19.700", "19.675 … 19.725", "0.025", "2.50", "6", "95", "0.010"]
    assert rows[3][3:5] == ["0.39", "1.96"]
    assert mass_and_centre(result, Report(coverage_factor=2.0)).rows[0][3:5] == ["0.020", "2.00"]
    assert result.to_dict()["mass"] == {
        "value": 19.7, "standard_uncertainty": 0.01, "interval95": pytest.approx([19.675, 19.725]),
        "from": "static poses", "conventional_bound": pytest.approx([19.675, 19.725]),
    }  # fmt: skip
    assert "19.675 … 19.725" in str(result)
    exact = changed(result, mass_uncertainty=None)
    assert mass_and_centre(exact, Report()).rows[0] == ["mass, kg", "19.7", *["–"] * 6]
    assert exact.to_dict()["mass"]["interval95"] is None


def test_conformity_stands_in_the_terminal_too(plain):
    limits = {"specification": "Drawing 4711", "rule": "simple", "limits": {"I11": ["0.3 kg*m^2", "0.4 kg*m^2"]}}
    shown = repr(Certificate(reported(declared(plain), conformity=limits)))
    assert "Conformity with Drawing 4711" in shown
    value, u = 1e3 * plain.inertia[0], 1e3 * plain.standard_uncertainty[0]
    within = NormalDist(value, u).cdf(400) - NormalDist(value, u).cdf(300)
    assert re.search(rf"I11 +300 … 400 +conforms +{100 * within:.2f}", shown)
    assert "Conformity" not in repr(Certificate(plain))


NAMES = ("I11", "I12", "I13", "I22", "I23", "I33")
LIMITS = {"specification": "drawing 4", "rule": "simple", "limits": {"I11": ["0.3 kg*m^2", "0.4 kg*m^2"]}}


def result_of(html):
    """The first part of the page, to the particulars."""
    return html[html.index('id="result"') : html.index('class="particulars"')]


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize(("part", "passes"), [(0.0, True), (0.333, True), (0.334, False), (np.nan, False)])
def test_nothing_passes_while_u_rests_on_typical_figures(full, part, passes):
    """No tick (that of a verdict without attention) and no sentence; nan: it is not known what undeclared errors do."""
    sound = dataclasses.replace(full, warnings=(), pooling=None)
    result = with_typical(sound, None) if np.isnan(part) else declared(sound, part)
    content = {**full.provenance["report"], "conformity": LIMITS}
    page = result_of(report(reported(result, **content)))
    assert ("is passed" in page) is passes
    assert ("U leaves out errors that nobody declared" in page or "is not known" in page) is not passes
    assert ("I11: undecided while undeclared errors are not known." in page) is bool(np.isnan(part))
    assert ("Conforms with drawing 4: I11." in page) is not np.isnan(part)


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize(("off", "passes"), [(4.9, True), (5.1, False)])
def test_nothing_is_certified_where_the_runs_contradict_what_is_declared(full, off, passes):
    mass = declaration("mass", 0, 19.7 + off * 0.01, 19.7, 0.01)
    result = dataclasses.replace(declared(full), warnings=(), pooling=None, declarations=(mass,))
    certificate = Certificate(reported(result, **{**full.provenance["report"], "conformity": LIMITS}))
    assert certificate.to_dict()["status"] == ("not contradicted" if passes else "contradicted")
    assert [decision.outcome for decision in certificate.decisions] == ["conforms" if passes else "undecided"]
    shown = " ".join(Reader(result_of(page(certificate))).text)
    assert ("is passed" in shown) is passes
    words = "The runs contradict what is declared of mass (5.1 u off): no interval is certified."
    assert (words in shown) is not passes
    assert ("I11: undecided while the runs contradict what is declared." in shown) is not passes
    assert any(note.startswith("contradicted: the runs") for note in certificate.notes()) is not passes
    first = "Nothing in the runs contradicts" if passes else "Do not use these figures"
    assert repr(certificate).splitlines()[1].startswith(first)
    warned = dataclasses.replace(result, declarations=(), warnings=("a clock jumped",))
    assert repr(warned).splitlines()[1].startswith("Read the warnings below")


@pytest.mark.usefixtures("blank_pictures")
def test_nothing_passes_while_items_are_not_stated(plain):
    sound = dataclasses.replace(declared(plain), warnings=(), pooling=None)
    text = " ".join(Reader(result_of(report(sound))).text)
    assert "is passed" not in text
    assert re.search(
        "Not stated, and asked for by ISO/IEC 17025: laboratory, customer, item,.* instruments, approval", text
    )


def sign(html):
    """The class of the verdict: that of a tick is empty."""
    return re.search(r'<p class="verdict ?(\w*)">', html)[1]


@pytest.mark.usefixtures("blank_pictures")
def test_no_warning_sign_stands_on_good_news(plain, full):
    """What is not stated or not declared takes the tick away, and adds no sign of warning: nobody did anything wrong."""
    sound = dataclasses.replace(declared(full), warnings=(), pooling=None)
    assert sign(report(sound)) == ""
    for result in (reported(sound), declared(sound, 0.5)):
        page = report(result)
        assert sign(page) == "open"
        assert "Attention" not in result_of(page)
        assert "for attention" not in result_of(page)
    assert sign(report(dataclasses.replace(sound, warnings=("a clock jumped",)))) == "attention"


@pytest.mark.usefixtures("blank_pictures")
def test_the_first_page_has_interval_and_bound_and_u_by_origin(plain):
    """U is of what is measured and declared; beside it the bound that typical errors widen by twice their u, in squares."""
    plain = declared(plain, 0.8)
    certificate = Certificate(plain)
    tensor, *_, origins = certificate.tables()
    added = plain.undeclared.standard_uncertainty[4:]
    np.testing.assert_allclose(certificate.tensor.standard, plain.standard_uncertainty)
    np.testing.assert_allclose(certificate.tensor.interval, plain.interval95)
    assert tensor.head[:6] == ["", "value", "coverage interval", "conventional bound, k = 2", "U", "k"]
    for row, u in zip(tensor.rows, added, strict=True):
        interval, bound = ([float(end.replace("−", "-")) for end in cell.split(" … ")] for cell in row[2:4])
        half = np.hypot(np.ptp(interval) / 2, 2e3 * u)
        assert np.ptp(bound) / 2 == pytest.approx(half, rel=0.06)
    assert origins.head == ["", "measured", "declared", "typical"]
    for name, row in zip(NAMES, origins.rows, strict=True):
        k = NAMES.index(name)
        parts = np.array([float(cell.replace("−", "-")) for cell in row[1:4]]) * 1e-3
        assert np.linalg.norm(parts[:2]) == pytest.approx(certificate.tensor.standard[k], rel=0.04)
        assert float(row[3]) == pytest.approx(1e3 * added[k], rel=0.05, abs=5e-5)


def test_in_concise_notation_each_value_has_its_standard_uncertainty(plain):
    with concise():
        (row, *_) = Certificate(plain).tables()[0].rows
    u = 1e3 * plain.standard_uncertainty[0]
    assert row[1] == f"{1e3 * plain.inertia[0]:.1f}({u:.1f})"


@pytest.mark.usefixtures("blank_pictures")
def test_delay_and_rotation_have_their_table_where_they_were_estimated(plain):
    delay = Aligned(np.array([2.1e-3]), np.diag([1e-8]), np.array([[1.9e-3, 2.3e-3]]), np.array([0.01]))
    turned = Aligned(np.deg2rad([1.0, -2.0, 0.5]), np.diag(np.deg2rad([0.1] * 3) ** 2),
                     np.deg2rad([[0.8, 1.2], [-2.2, -1.8], [0.3, 0.7]]), np.array([0.1, 0.2, 0.9]))  # fmt: skip
    (found,) = alignment(dataclasses.replace(plain, delay=delay, rotation=turned))
    assert found.rows[0] == ["delay of the IMU, ms", "2.10", "0.10", "1.90 … 2.30", "1.0"]
    assert found.rows[2] == ["rotation vector of the IMU, deg, b2", "−2.00", "0.10", "−2.20 … −1.80", "20.0"]
    assert alignment(plain) == []
    assert "Alignment of load cell and IMU" in report(dataclasses.replace(plain, delay=delay, rotation=turned))


@pytest.mark.usefixtures("blank_pictures")
def test_every_item_stands_on_the_page_and_nothing_is_lost(full):
    html = report(full)
    page = Reader(html)
    text = " ".join(page.text)
    table = tomllib.loads(FULL)["report"]
    for key in ("title", "number", "location", "method", "traceability"):
        assert table[key] in text
    for words in (
        "Test hall", "1 Street", "A customer", "drone", "serial number 17", "2026-03-02", "2026-03-04 to 2026-03-05",
        "temperature: (21.3 ± 0.5) °C", "Approved by A. Person, head; issued 2026-03-09", "LC-1", "K 17", "2025-04-01",
        "Conformity with drawing 4", "guarded acceptance", "relate only to the item", "No accreditation is claimed",
        "The data are simulated", "End of 2026-0173", "Checks", "Budget: contributions",
    ):  # fmt: skip
        assert words in text, words
    assert all(entry["sha256"] in text for entry in full.provenance["inputs"])
    assert full.provenance["experiment_file"]["sha256"] in text
    assert {"script", "link"}.isdisjoint(page.tags)
    assert all(page.values("aria-label"))
    assert [row[3] for row in of_tensor(full, factor=2.0).rows(1e3)] == ["2.00"] * 6


def test_measured_and_predicted_moment_stand_over_one_another(plain):
    """Of each run and axis. The prediction is Newton and Euler's moment of the true tensor, within the tensor's u."""
    panels = plain.figures()["moment"].axes
    assert [axes.get_title(loc="left") for axes in panels[:3]] == ["run-0.mcap, M1", "M2", "M3"]
    assert len(panels) == 3 * len(plain.runs)
    true = Experiment.from_dict(tomllib.loads(T1))
    motion = true.motion("T1")
    moment = np.asarray(jax.vmap(omega_r)(motion.omega, motion.alpha) @ true.body.inertia)
    for k, axes in enumerate(panels[:3]):
        measured, predicted = axes.get_lines()
        assert [measured.get_label(), predicted.get_label()] == ["measured", "predicted"]
        exact = np.interp(predicted.get_xdata(), motion.t, moment[:, k])
        assert np.std(predicted.get_ydata() - exact) < 0.03  # N·m: twice 3.5 g·m² times 4 rad/s²
        assert np.std(measured.get_ydata() - exact) == pytest.approx(float(plain.runs[0].residual[k]), rel=0.2)


def test_figures_of_runs_have_whole_numbers_and_labels_apart(plain):
    figures = plain.figures()
    runs, spectrum = figures["runs"].axes, figures["residuals"].axes[1]
    for figure in (figures["runs"], figures["residuals"]):
        figure.draw_without_rendering()
    assert all(float(text.get_text()).is_integer() for axes in runs for text in axes.get_xticklabels())
    for axis in (spectrum.xaxis, spectrum.yaxis):
        low, high = sorted(axis.get_view_interval())
        ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        boxes = [tick.label1.get_window_extent() for tick in ticks if tick.label1.get_text()]
        assert len(boxes) > 1
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[k + 1 :])
    assert [len(legend.get_texts()) for legend in figures["parts"].legends] == [1]
    assert not any(axes.get_legend() for axes in figures["parts"].axes)
    assert "runs" not in dataclasses.replace(plain, runs=plain.runs[:1]).figures()


@pytest.mark.usefixtures("blank_pictures")
def test_what_is_missing_is_not_stated(plain):
    text = Reader(report(plain)).text
    assert text.count("not stated") >= 12
    assert "Inertia tensor of a body" in text
    assert "accredit" not in " ".join(text).lower().replace("no accreditation is claimed", "")


@pytest.mark.usefixtures("blank_pictures", "unjudged")
def test_warnings_of_dates_reach_result_and_page(runs, monkeypatch):
    monkeypatch.setattr(identify_module, "with_declared_sources", lambda result, *_, **__: result)
    document = tomllib.loads(T1 + FULL)
    document["report"]["instrument"][0]["due"] = "2026-03-01"
    result = identify_files([runs / "run-0.mcap"], Experiment.from_dict(document))
    (warning,) = [text for text in result.warnings if "was due" in text]
    html = report(result)
    assert warning in html[html.index('<div class="attention"') : html.index('class="particulars"')]
    assert checks.rows(result)[-1][3] == "see Attention"


TURNED = """
[[source]]
name = "KIND"
target = "omega"
kind = "KIND"
sigma = "1e-3 UNIT"
group = "imu"
"""


@pytest.mark.usefixtures("unjudged")
@pytest.mark.parametrize(("kind", "unit", "left"), [("misalignment", "rad", "in time"), ("delay", "s", "in frame")])
def test_what_is_declared_is_not_assumed_away(runs, kind, unit, left, monkeypatch):
    monkeypatch.setattr(identify_module, "with_declared_sources", lambda result, *_, **__: result)
    source = TURNED.replace("KIND", kind).replace("UNIT", unit)
    result = identify_files([runs / "run-0.mcap"], Experiment.from_dict(tomllib.loads(T1 + source)))
    assert [text for text in result.assumptions if "aligned" in text] == [f"load cell and IMU are aligned {left}"]


@pytest.mark.usefixtures("blank_pictures")
def test_the_number_is_that_of_the_content(plain):
    content = files(Certificate(plain))
    number = json.loads(content["result.json"])["certificate"]
    assert number in content["report.html"].decode()
    assert number == number_of(plain.to_dict())
    later = dataclasses.replace(plain, provenance={**plain.provenance, "time": "2030-01-01T00:00:00+00:00"})
    assert number_of(later.to_dict()) == number
    other = reported(plain, customer={"name": "another"})
    assert number_of(other.to_dict()) != number
    assert number_of(changed(plain, inertia=plain.inertia * (1 + 1e-12)).to_dict()) != number


def test_every_file_that_went_in_is_named_once():
    provenance = {
        "inputs": [{"file": "a", "sha256": "1"}, {"file": "b", "sha256": "2", "more": {"file": "c", "sha256": "3"}}],
        "others": [{"inputs": ({"file": "a", "sha256": "1"}, {"file": "d", "sha256": None})}],
    }
    assert input_table(provenance).rows == [("a", "1"), ("b", "2"), ("c", "3")]


@pytest.mark.usefixtures("blank_pictures")
def test_hostile_particulars_are_text(plain):
    table = copy.deepcopy(tomllib.loads(FULL)["report"])
    table |= {"title": HOSTILE, "number": HOSTILE, "customer": {"name": HOSTILE}, "conditions": {HOSTILE: HOSTILE}}
    page = Reader(report(reported(plain, **table)))
    assert "script" not in page.tags
    assert HOSTILE in page.text


@needs_chromium
@needs_poppler
@needs_font
def test_it_prints_as_a_numbered_a4_document_without_complaint(full, tmp_path):
    html = report(full)
    _, printed, complaints = drawn(html, tmp_path)
    assert complaints == []
    pages = (
        subprocess.run(["pdftotext", printed, "-"], check=True, capture_output=True).stdout.decode().split("\f")[:-1]
    )
    assert 4 <= len(pages) <= 7
    for k, text in enumerate(pages, 1):
        assert "2026-0173" in text
        assert f"page {k} of {len(pages)}" in text
        assert len(text.split()) > 20  # no empty page
    assert "Conformity with" in pages[0]
    assert "End of 2026-0173" in pages[-1]


@pytest.mark.study
@needs_chromium
def test_the_browser_would_complain_of_a_request(plain, tmp_path):
    """The oracle of the test above."""
    html = report(plain).replace("</body>", '<img alt="" src="http://127.0.0.1:9/x.png"></body>')
    assert any("127.0.0.1:9" in text for text in drawn(html, tmp_path)[2])
