"""Sliders in a real browser: what they show against the law of the experiment that they stand for."""

import dataclasses

import numpy as np
import pytest

from tests.helpers.adjustable_lab import bars, delays, shown, widget_page
from tests.helpers.driven_browser import Browser, needs_chromium
from uq.analysis.propagation.experiment_law import law, prepare_law
from uq.plan.measurement.adjustable_motion import changed, explorable
from uq.plan.measurement.explore import explore
from uq.plan.measurement.required_duration import shortest

SLIDER = ".adjustable tbody tr:nth-child({}) input[type=range]"
FRAME = 100.0
"""Within which bars must follow [ms]."""


@pytest.fixture(scope="module")
def experiment(preset):
    """T1 of 20 s at 100 Hz, one estimator matched to it."""
    spec = preset.trajectories["T1"]
    trajectory = dataclasses.replace(
        spec.trajectory, duration=np.array(20.0), ramp=np.array(3.0), precessions=np.array(4.0)
    )
    spec = dataclasses.replace(spec, duration=20.0, rate=100.0, trajectory=trajectory)
    return dataclasses.replace(preset, trajectories={"T1": spec}, estimators=preset.estimators[1:], document={})


@pytest.fixture(scope="module")
def numbers(experiment):
    return explorable(prepare_law(experiment))


@pytest.fixture
def browser(numbers, tmp_path):
    with Browser(tmp_path, widget_page(numbers)) as opened:
        yield opened
        assert opened.complaints == []


def compare(browser, given, names=("T1", "smoothed"), rtol=1e-2):
    total = law(given, *names)[names].total
    spread, mean = shown(browser, 0)
    np.testing.assert_allclose(spread, 1e3 * total.three_sigma, rtol=rtol)  # three figures are shown
    np.testing.assert_allclose(mean, 1e3 * total.mean_error, rtol=rtol, atol=rtol * 1e3 * total.three_sigma.min())


@needs_chromium
def test_bars_follow_a_slider(browser, experiment):
    """A key moves it by a hundredth of a decade; a click to where one clicks. Both heard by the kernel's model."""
    compare(browser, experiment)
    before = bars(browser)
    row = 1 + [s.name for s in experiment.sources].index("M_precision")
    browser.click(SLIDER.format(row + 1))  # the focus
    took = delays(browser, lambda _: browser.press("ArrowRight"))
    assert len(took) == 9
    assert took[4] < FRAME, took  # the median, since the machine may be busy
    browser.press("ArrowRight", 41)
    state = browser.run("model.get('state')")
    assert state["factors"][row - 1] == pytest.approx(10**0.5, rel=0.05)
    assert np.abs(bars(browser) - before).max() > 5
    sources = tuple(s.resized(float(f)) for s, f in zip(experiment.sources, state["factors"], strict=True))
    compare(browser, dataclasses.replace(experiment, sources=sources))
    browser.click(SLIDER.format(row + 1), along=0.25)
    assert browser.run("model.get('state')")["factors"][row - 1] < 0.6
    browser.click(".adjustable button")
    compare(browser, experiment)
    np.testing.assert_allclose(bars(browser), before)


@needs_chromium
@pytest.mark.parametrize(("name", "rtol"), [("duration", 2e-2), ("amplitude", 5e-2)])
def test_the_motions_sliders(browser, experiment, name, rtol):
    """At the ends, where the law was evaluated, and between."""
    places = "document.querySelectorAll('.controls input[type=range]')"
    slider = f"{places}[{['duration', 'amplitude'].index(name)}]"
    for key, times, factor, allowed in (
        ("End", 1, 2.0, 1e-2),
        ("Home", 1, 0.5, 1e-2),
        ("ArrowRight", 150, 2**0.5, rtol),
    ):
        browser.run(f"{slider}.focus()")
        browser.press(key, times)
        assert browser.run("model.get('state')")[name] == pytest.approx(factor, rel=0.02)
        factors = {"duration": 1.0, "amplitude": 1.0, name: factor}
        spec = changed(experiment.trajectories["T1"], **factors)
        compare(browser, dataclasses.replace(experiment, trajectories={"T1": spec}), rtol=allowed)


@needs_chromium
def test_the_kernel_moves_the_sliders(browser, experiment):
    browser.run("model.set('state', {pair: 0, factors: [2, 1, 1, 1, 1, 1, 1], duration: 1, amplitude: 1})")
    assert browser.run("document.querySelector('tbody tr:nth-child(2) input').value") == "20"
    assert browser.run("globalThis.saved") is None  # what it has said is not said back
    controls = browser.run("document.querySelectorAll('input, select, button').length")
    marked = browser.run("document.querySelectorAll('[data-lm-suppress-shortcuts]').length")
    assert controls == marked > 10  # else JupyterLab takes arrows and Enter for its own


@needs_chromium
def test_an_exported_notebook_shows_the_last_state(experiment, numbers, tmp_path):
    """Of its cells an export keeps what `nbclient` and JupyterLab save of a widget: here the script draws it again."""
    widgets = pytest.importorskip("ipywidgets")
    widget = explore(experiment)
    factors = [1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 3.0]
    widget.state = {"pair": 0, "factors": factors, "duration": 1.0, "amplitude": 1.0}
    saved = widgets.Widget.get_manager_state(widgets=[widget])["state"][widget.model_id]["state"]
    assert saved["_esm"] == widget._esm
    with Browser(tmp_path, widget_page(saved["law"], saved["state"])) as opened:
        sources = tuple(s.resized(f) for s, f in zip(experiment.sources, factors, strict=True))
        compare(opened, dataclasses.replace(experiment, sources=sources))
        assert opened.run("document.querySelectorAll('tr.changed').length") == 2
        assert opened.complaints == []


@needs_chromium
def test_what_is_typed_is_left_alone(browser):
    """The kernel's model hears of each change, which must not rewrite a number that is being typed."""
    number = "document.querySelector('tbody tr:nth-child(2) input')"
    browser.run(f"{number}.select()")
    browser.type("12.50")
    assert browser.run(f"{number}.value") == "12.50"
    assert browser.run("model.get('state')")["factors"][0] == pytest.approx(1.25)
    browser.press("Tab")
    assert browser.run(f"{number}.value") == "12.5"


def test_a_slider_ends_where_ramps_leave_no_motion(numbers, preset, experiment):
    assert numbers["pairs"][0]["motion"]["duration"]["least"] == 0.5
    assert shortest(preset.trajectories["T3"]) == pytest.approx(6 * 27.0)  # three motions, each with two ramps
    assert shortest(preset.trajectories["T1"]) == pytest.approx(2 * 27.0)


def test_the_widget_knows_the_experiment_as_it_stands(experiment):
    pytest.importorskip("anywidget")
    widget = explore(experiment)
    assert widget.experiment is experiment
    factors = [1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 3.0]
    widget.state = {"pair": 0, "factors": factors, "duration": 1.5, "amplitude": 0.5}
    now = widget.experiment
    np.testing.assert_allclose(now.sources[2].sigma, 0.5 * experiment.sources[2].sigma)
    np.testing.assert_allclose(now.sources[6].sigma, 3 * experiment.sources[6].sigma)
    spec = now.trajectories["T1"]
    assert spec.duration == pytest.approx(30.0)
    assert float(spec.trajectory.angular_velocity) == pytest.approx(0.5 * 0.425)
    assert float(spec.trajectory.angular_acceleration) == pytest.approx(2.0)
