"""The report's table of sources whose figures can be changed: in a real browser, by keyboard, offline."""

import dataclasses
import hashlib
import re
from base64 import b64encode

import numpy as np
import pytest

from tests.helpers.adjustable_lab import bars, delays, shown
from tests.helpers.browser import Reader
from tests.helpers.driven_browser import Browser, needs_chromium
from uq.analysis.propagation.experiment_law import law
from uq.report.report_files import report

NUMBER = ".adjustable tbody tr:nth-child({}) input[type=number]"


@pytest.fixture(scope="module")
def page(brief):
    return report(law(brief, ["T1", "T3"]))


@pytest.fixture
def browser(page, tmp_path):
    with Browser(tmp_path, page) as opened:
        yield opened
        assert opened.complaints == []
        assert len(opened.requests) == 1  # the page itself


def test_the_page_allows_no_script_but_its_own(page, brief):
    policy = next(value for value in Reader(page).values("content") if "default-src" in value)
    (script,) = re.findall(r'<script type="module">(.*?)</script>', page, flags=re.S)
    digest = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'")
    assert page.count("<script") == 2  # it, and the numbers
    hostile = dataclasses.replace(brief.sources[0], name="</script><script>alert(1)</script>")
    other = report(law(dataclasses.replace(brief, sources=(hostile, *brief.sources[1:]), document={}), "T1", "central"))
    assert other.count("<script") == 2


@needs_chromium
def test_a_typed_figure_changes_the_rows(browser, brief):
    before, row = bars(browser), 1 + [s.name for s in brief.sources].index("omega_precision")
    label = browser.run(f"document.querySelector('{NUMBER.format(row + 1)}').getAttribute('aria-label')")
    assert label == "σ of omega precision in rad/s, largest axis"
    browser.run(f"document.querySelector('{NUMBER.format(row)}').focus()")
    browser.press("Tab", 2)  # past its slider
    assert browser.run("document.activeElement.getAttribute('aria-label')") == label
    browser.run("document.activeElement.select()")
    texts = [f"0.00{digits}" for digits in (19, 17, 15, 13, 11, 12, 14, 16, 18, "095")]

    def typed(number):
        browser.run("document.activeElement.select()")
        browser.type(texts[number + 1])

    took = delays(browser, typed)
    assert len(took) == 9
    assert took[4] < 100, took  # ms, the median, since the machine may be busy
    quieter = tuple(s.resized(0.5) if s.name == "omega_precision" else s for s in brief.sources)
    total = law(dataclasses.replace(brief, sources=quieter), ["T1", "T3"])["T1", "central"].total
    spread, mean = shown(browser, 0)
    np.testing.assert_allclose(spread, 1e3 * total.three_sigma, rtol=1e-2)
    np.testing.assert_allclose(mean[[0, 5]], 1e3 * total.mean_error[[0, 5]], rtol=1e-2)
    assert (
        browser.run(f"document.querySelector('.adjustable tbody tr:nth-child({row + 1})').title")
        == "stated: 0.0019 rad/s"
    )
    browser.click(".adjustable button")
    np.testing.assert_allclose(bars(browser), before)
    assert browser.run(f"document.querySelector('{NUMBER.format(row + 1)}').value") == "0.0019"


@needs_chromium
def test_another_run_and_estimator_is_chosen(browser, brief):
    browser.run("document.querySelector('.adjustable select').focus()")
    browser.press("End")
    total = law(brief, ["T1", "T3"])["T3", "smoothed"].total
    np.testing.assert_allclose(shown(browser, 0)[0], 1e3 * total.three_sigma, rtol=1e-2)


@needs_chromium
def test_a_rows_part_follows_the_square(browser, brief):
    """The load cell's noise twice as large: its part doubles, the others' stay."""
    row = 1 + [s.name for s in brief.sources].index("M_precision")
    before = [shown(browser, k)[0] for k in range(len(brief.sources) + 1)]
    browser.run(f"document.querySelector('{NUMBER.format(row + 1)}').select()")
    browser.type("0.92")
    after = [shown(browser, k)[0] for k in range(len(brief.sources) + 1)]
    np.testing.assert_allclose(after[row], 2 * before[row], rtol=2e-2)
    for k in set(range(1, len(after))) - {row}:
        np.testing.assert_array_equal(after[k], before[k])
    np.testing.assert_allclose(np.square(after[1:]).sum(axis=0), np.square(after[0]), rtol=3e-2)


@needs_chromium
def test_it_follows_the_readers_scheme_and_width(browser, tmp_path):
    grounds = []
    for dark in (False, True):
        browser.picture(tmp_path / "page.png", width=390, dark=dark)
        grounds.append(browser.run("getComputedStyle(document.body).backgroundColor"))
        assert browser.run("document.documentElement.scrollWidth") <= 390
    assert grounds[0] == "rgb(255, 255, 255)"
    assert grounds[1] == "rgb(22, 22, 22)"
