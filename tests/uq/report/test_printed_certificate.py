"""The printed certificate: what is signed stands on its first page, on A4 and on Letter, whatever the result."""

import base64
import dataclasses
import re
import subprocess
import tomllib

import numpy as np
import pytest

from identify.estimation.joint.prior_departure import declaration
from tests.helpers.driven_browser import Browser, needs_chromium, needs_poppler
from tests.helpers.pose_lab import directions
from tests.helpers.report_tables import FULL, T1
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.report.certificate.certificate import Certificate
from uq.report.report_files import report
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.static_centre import centre_file

PAPERS = {"A4": (594.96, 841.92), "Letter": (612.0, 792.0)}
"""Width and height [pt] as Chromium makes them."""
LONG = """
[report]
title = "Calibration certificate of the inertia tensor of a drone with its landing gear and its battery"
laboratory = { name = "Test hall", address = "1 Street", contact = "hall@example.org" }
reproduction = "Only as a whole, and with the approval of the test hall, which keeps the recordings for ten years"
approved_by = [{ name = "A. Person", function = "head" }, { name = "B. Person", function = "deputy" }, { name = "C. Person", function = "test" }]

[report.conformity]
specification = "drawing 4, revision 12"
rule = "guarded"
limits = { I11 = ["300 g*m^2", "0.4 kg*m^2"], I12 = ["-5 g*m^2", "5 g*m^2"], I13 = ["-5 g*m^2", "5 g*m^2"], I22 = ["18 g*m^2", "19 g*m^2"], I23 = ["-5 g*m^2", "5 g*m^2"], I33 = ["370 g*m^2", "380 g*m^2"] }
"""
POSES = """
[poses]
force = ["fx", "fy", "fz"]
moment = ["tx", "ty", "tz"]
acceleration = ["ax", "ay", "az"]
"""
UNDECLARED = 'undeclared = "none"'


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two recorded runs, and a table of static poses of the same body."""
    folder = tmp_path_factory.mktemp("runs")
    for seed in (0, 1):
        simulate(Experiment.from_dict(tomllib.loads(T1)), seed=seed).write(folder / f"run-{seed}.mcap")
    rng = np.random.default_rng(0)
    f = directions(rng, 20, 0.35)
    noise = rng.normal(size=(20, 6)) * [0.2, 0.2, 0.2, 0.005, 0.005, 0.005]
    table = np.hstack([np.hstack([19.7 * f, np.cross([0, 0, 0.053], 19.7 * f)]) + noise, f])
    heads = "fx,fy,fz,tx,ty,tz,ax,ay,az"
    np.savetxt(folder / "poses.csv", table, "%.9g", ",", header=heads, comments="")
    return folder


def clean(runs):
    """One run, nothing to object to."""
    return identify_files([runs / "run-0.mcap"], Experiment.from_dict(tomllib.loads(T1 + FULL)))


def contradicted(runs):
    """The same, as if the runs had told another mass and another place of the centre of gravity."""
    wrong = declaration("mass", 0, 18.7, 19.7, 0.02), declaration("r_cg", 2, 0.061, 0.053, 1e-4)
    return dataclasses.replace(posed_and_repeated(runs), declarations=wrong)


def posed_and_repeated(runs):
    """Two runs, mass and centre of gravity from static poses; nothing said of undeclared errors, limits of all components."""
    experiment = Experiment.from_dict(tomllib.loads(T1.replace(UNDECLARED, "") + POSES + LONG))
    centre = centre_file(runs / "poses.csv", experiment)
    return identify_files(sorted(runs.glob("*.mcap")), experiment, centre=centre)


def first_page(browser, html, folder, paper):
    """Text of the first page as printed, and the size of the pages [pt]."""
    browser.show_page(html.replace("size: A4", f"size: {paper}"))
    printed = folder / "certificate.pdf"
    printed.write_bytes(base64.b64decode(browser.call("Page.printToPDF", preferCSSPageSize=True)["data"]))
    about = subprocess.run(["pdfinfo", printed], check=True, capture_output=True, text=True).stdout
    size = tuple(map(float, re.search(r"Page size: +([\d.]+) x ([\d.]+)", about).groups()))
    text = subprocess.run(["pdftotext", "-l", "1", printed, "-"], check=True, capture_output=True, text=True).stdout
    return " ".join(text.split()), size


@needs_chromium
@needs_poppler
@pytest.mark.parametrize(
    "made", [posed_and_repeated, *(pytest.param(made, marks=pytest.mark.slow) for made in (clean, contradicted))]
)
def test_verdict_tensor_and_signature_stand_on_the_first_page(made, runs, tmp_path):
    certificate = Certificate(made(runs))
    html = report(certificate)
    with Browser(tmp_path, html) as browser:
        for paper, size in PAPERS.items():
            text, printed_size = first_page(browser, html, tmp_path, paper)
            assert printed_size == size
            assert " ".join(certificate.verdict().split()) in text
            assert "Inertia tensor about the centre of gravity" in text
            for value in (cell for row in certificate.tables()[0].rows for cell in row[:3]):
                assert value in text, (paper, value)
            assert "Mass and centre of gravity" in text
            for person, _ in certificate.section().front.approvals:
                assert f"Approved by {person}" in text, paper
        assert browser.complaints == []
