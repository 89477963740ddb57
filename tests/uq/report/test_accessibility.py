"""Pages in a browser: judged by axe-core, and read at a phone's width.

axe-core is no dependency; ``make axe-core`` fetches it.
"""

import tomllib

import pytest

from tests.helpers.driven_browser import PHONE, Browser, needs_axe, needs_chromium, needs_font
from tests.helpers.report_tables import FULL, T1
from tests.helpers.small_campaign import campaign, paper_result
from uq.analysis.propagation.experiment_law import law
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.report.certificate.certificate import Certificate
from uq.report.report_files import report
from uq.runs.identification.identify_files import identify_files


@pytest.fixture(scope="module")
def certificate(tmp_path_factory):
    run = tmp_path_factory.mktemp("run") / "run.mcap"
    experiment = Experiment.from_dict(tomllib.loads(T1 + FULL))
    simulate(Experiment.from_dict(tomllib.loads(T1))).write(run)
    return report(Certificate(identify_files([run], experiment)))


@pytest.fixture
def browser(request, tmp_path, certificate, brief):
    make = {
        "certificate": lambda: certificate, "campaign": lambda: report(campaign("T1")),
        "paper": lambda: report(paper_result()), "law": lambda: report(law(brief, ["T1"], "central")),
    }  # fmt: skip
    with Browser(tmp_path, make[request.param]()) as opened:
        opened.unfold()
        yield opened


@needs_chromium
@pytest.mark.parametrize(
    "browser",
    ["certificate", "campaign", *(pytest.param(name, marks=pytest.mark.slow) for name in ("paper", "law"))],
    indirect=True,
)
@needs_axe
def test_axe_core_objects_to_nothing(browser):
    assert browser.violations_on_screens() == {}
    browser.run("document.querySelector('main').insertAdjacentHTML('beforeend', '<img src=\"data:,\">')")
    assert [text.split(":")[0] for text in browser.violations()] == ["image-alt"]  # it would object


@needs_chromium
@needs_font
@pytest.mark.parametrize("browser", ["certificate", "campaign"], indirect=True)
def test_a_phone_shows_value_and_interval_and_nothing_beside_the_page(browser):
    browser.show(PHONE)
    assert browser.run("document.documentElement.scrollWidth") <= PHONE
    heads, ends = browser.run("""(() => {
      const cells = [...document.querySelector('.headline thead tr').children];
      return [cells.map((cell) => cell.textContent), cells.map((cell) => cell.getBoundingClientRect().right)];
    })()""")
    for head, end in zip(heads, ends, strict=True):
        if "interval" in head or head in ("value", "mean error", "T1"):
            assert end <= PHONE, (head, end)
    top = browser.run("document.querySelector('.headline tbody tr:last-child').getBoundingClientRect().bottom")
    assert top <= 844  # and without scrolling
