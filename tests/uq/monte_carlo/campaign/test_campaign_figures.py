"""Figures carry the numbers they are drawn from, say their units, and leave matplotlib's settings alone."""

from dataclasses import replace
from functools import cache

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import PathCollection, PolyCollection
from matplotlib.container import BarContainer
from matplotlib.figure import Figure

from identify.rigid_body.inertia import COMPONENTS, MOMENTS, PRODUCTS
from tests.helpers.small_campaign import campaign
from uq.experiment.experiment import Experiment
from uq.monte_carlo.barreto2016 import PRINTED
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult, average
from uq.monte_carlo.campaign.statistics import Breakdown, Statistics
from uq.report.figures import paper as plots
from uq.report.figures.campaign import BESIDE, LINES, contributions
from uq.report.figures.style import display_name


def heights(axes):
    return {c.get_label(): [bar.get_height() for bar in c] for c in axes.containers if isinstance(c, BarContainer)}


def half_lengths(lines, axis=1):
    """Half lengths of the lines that are standard errors, by case."""
    return np.reshape([np.ptp(segment[:, axis]) / 2 for segment in lines.get_segments()], (-1, len(COMPONENTS)))


def read(axes, x, column):
    """What stands at these places of a column with a linear scale, by its labels."""
    labels = [(text.xy[0], float(text.get_text().replace("−", "-"))) for text in axes.texts if hasattr(text, "xy")]
    places, values = np.transpose([pair for pair in labels if column <= pair[0] < column + 1])
    return np.polyval(np.polyfit(places, values, 1), x)


def statistics(mean, sigma):
    return Statistics(*(1e-3 * np.broadcast_to(np.asarray(v, float), 6) for v in (mean, 0.1, sigma, 0.2)))


def test_contributions_carry_the_statistics():
    cases = campaign()["T1", "central"].groups
    top, bottom = contributions(cases).axes
    assert list(heights(top)) == [display_name(name) for name in cases]
    for name, s in cases.items():
        np.testing.assert_allclose(heights(top)[display_name(name)], 1e3 * s.three_sigma)
    (bars,) = (c.lines[2][0] for c in top.containers if not isinstance(c, BarContainer))
    lines, marks, *_ = bottom.collections
    expected = {name: [1e3 * getattr(s, name) for s in cases.values()] for name in Statistics.__dataclass_fields__}
    np.testing.assert_allclose(half_lengths(bars), expected["three_sigma_standard_error"], atol=1e-12)
    np.testing.assert_allclose(marks.get_offsets()[:, 1], np.ravel(expected["mean_error"]))
    np.testing.assert_allclose(half_lengths(lines), expected["mean_error_standard_error"], atol=1e-12)
    assert [label.get_text() for label in bottom.get_xticklabels()] == list(COMPONENTS)


def test_many_cases_have_a_line_each_the_largest_first():
    """Groups before sources, of which the smallest are left out."""
    cases = {"total": statistics(0, 9)} | {f"s{k}": statistics(-0.1 * k, k) for k in range(20)}
    top, bottom = contributions(cases, ("s1", "s5")).axes
    sources = [f"s{k}" for k in range(19, -1, -1) if k not in (1, 5)]
    names = ["total", "s5", "s1", *sources[:LINES]]
    shown = [cases[name] for name in names]
    assert [text.get_text() for text in top.get_yticklabels()] == names
    assert [text.get_text() for text in top.texts if text.get_text() in COMPONENTS] == list(COMPONENTS)
    bars = [c for c in top.collections if isinstance(c, PolyCollection)]
    (marks,) = (c for c in bottom.collections if isinstance(c, PathCollection))
    points = marks.get_offsets()[:, 0].reshape(-1, len(COMPONENTS))
    for k in range(len(COMPONENTS)):
        ends = [paths.get_paths()[k].get_extents().x1 for paths in bars]
        np.testing.assert_allclose(read(top, ends, k), [1e3 * s.three_sigma[k] for s in shown])
        np.testing.assert_allclose(read(bottom, points[:, k], k), [1e3 * s.mean_error[k] for s in shown], atol=1e-12)


@pytest.mark.parametrize("count", [4, 5, 24])
def test_nothing_is_clipped_and_no_labels_collide(count):
    figure = contributions({f"a_rather_long_name_{k}": statistics(-40.0 * (k == 0), k + 1) for k in range(count)})
    figure.draw_without_rendering()
    legends = [text for legend in figure.legends for text in legend.get_texts()]
    for axes in figure.axes:
        low, high = axes.get_xlim()
        labels = [text for text in axes.get_xticklabels() if text.get_text() and low <= text.get_position()[0] <= high]
        labels += [text for text in axes.texts if hasattr(text, "xy") and count > BESIDE]
        boxes = [text.get_window_extent() for text in labels]
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[k + 1 :]), axes.get_title()
        legends += labels
    for text in legends:
        box = text.get_window_extent()
        assert figure.bbox.containsx(box.x0), text
        assert figure.bbox.containsx(box.x1), text


def test_a_mean_error_beyond_its_dispersion_is_written_out():
    cases = {"total": statistics([0, 0, 0, 0, 0, -30.6], 3), "imu": statistics(0, 1)}
    bottom = contributions(cases).axes[1]
    assert [text.get_text() for text in bottom.texts] == ["−30.6"]
    assert bottom.get_yscale() == "symlog"
    calm = contributions({"total": statistics(0.1, 3)}).axes[1]
    assert (calm.get_yscale(), len(calm.texts)) == ("linear", 0)


@pytest.mark.parametrize(
    ("mean", "names"), [(-3000, ["−10000", "0"]), (-30, ["−10", "−1", "0"]), (3, ["0", "1.5", "3"])]
)
def test_a_column_names_nought_and_how_far_it_goes(mean, names):
    """A mean error beyond every 3σ has a logarithmic scale, whose decades begin below the largest 3σ."""
    cases = {f"{k}": statistics(mean * (k == 0), 5) for k in range(7)}
    cases = {name: replace(s, mean_error_standard_error=0 * s.mean_error) for name, s in cases.items()}
    _, bottom = contributions(cases).axes
    assert [text.get_text() for text in bottom.texts if text.xy[0] < 1] == names


def test_every_mark_lies_inside_its_panel():
    figure = contributions({"total": statistics([0, 0, 0, 0, 0, -30.6], 3)})
    figure.draw_without_rendering()
    bottom = figure.axes[1]
    low, high = (bottom.transData.transform((0, value))[1] for value in (-30.6, 0.1))
    radius = 2.6 / 2 * figure.dpi / 72
    assert low - radius > bottom.bbox.y0
    assert high + radius < bottom.bbox.y1


def test_averages_carry_the_statistics_and_the_printed_values():
    figure = plots.averages(campaign(), "central", PRINTED)
    top, bottom = figure.axes
    for kind, components in (("moments", MOMENTS), ("products", PRODUCTS)):
        totals = [campaign()[name, "central"].total for name in ("T1", "T2", "T3", "T4")]
        sigma = [1e3 * t.three_sigma[list(components)].mean() for t in totals]
        mean = [1e3 * np.abs(t.mean_error[list(components)]).mean() for t in totals]
        np.testing.assert_allclose(heights(top)[kind], sigma)
        np.testing.assert_allclose(heights(bottom)[kind], mean)
    drawn = [line.get_ydata().tolist() for line in top.lines if line.get_marker() == "D"]
    assert drawn == [list(PRINTED[f"3σ {kind}"].values()) for kind in ("moments", "products")]
    assert "paper" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_standard_errors_of_averages_hold():
    """Against the scatter of the averages over 400 campaigns.

    The scatter is known to 1/sqrt(2·400) = 3.5 %: 12 % is 3.4 standard errors, a false alarm of 0.14 % for the two.
    """
    rng = np.random.default_rng(0)
    mixing = rng.normal(size=(6, 6))
    found = np.array([average(synthetic(rng, mixing), "T", "e", MOMENTS) for _ in range(400)])
    scatter = found.std(axis=0, ddof=1)
    np.testing.assert_allclose(found[:, 1].mean(), scatter[0], rtol=0.12)
    np.testing.assert_allclose(found[:, 3].mean(), scatter[2], rtol=0.12)


def synthetic(rng, mixing):
    errors = (rng.normal(size=(200, 6)) @ mixing + 5)[:, None, None, :]
    return MonteCarloResult(200, 0, np.ones(6), {"T": {"e": Breakdown({}, {}, 0)}}, (), {}, {"T": errors})


def test_motions_are_drawn_as_they_are():
    t, omega, alpha = plots.rates(Experiment.load("barreto2016").trajectories["T1"])
    assert len(t) <= plots.POINTS
    np.testing.assert_allclose(np.max(np.linalg.norm(omega, axis=0)), 0.425, rtol=0.01)  # the paper's sphere
    np.testing.assert_allclose(np.max(np.linalg.norm(alpha, axis=0)), 4.0, rtol=0.05)  # the ramps add a little
    for axes, path in zip(plots.spheres(omega, alpha).axes, (omega, alpha), strict=True):
        segments = np.array(axes.collections[0]._segments3d)
        assert sorted(map(tuple, segments[:, 0])) == sorted(map(tuple, path.T[:-1]))
        assert len({axes.get_xlim(), axes.get_ylim(), axes.get_zlim()}) == 1
    for axes, values in zip(plots.angular_velocity(t, omega).axes, omega, strict=True):
        np.testing.assert_array_equal(axes.lines[-1].get_ydata(), values)


@cache
def every_figure():
    t, omega, alpha = plots.rates(Experiment.load("barreto2016").trajectories["T3"])
    return {
        "spheres": plots.spheres(omega, alpha),
        "angular_velocity": plots.angular_velocity(t, omega),
        "contributions": contributions(campaign()["T1", "central"].groups),
        "averages": plots.averages(campaign(), "smoothed"),
    }


@pytest.mark.parametrize("name", ["spheres", "angular_velocity", "contributions", "averages"])
def test_labels_state_units(name):
    figure = every_figure()[name]
    assert isinstance(figure, Figure)
    for axes in figure.axes:
        labels = [axes.get_ylabel()] + ([axes.get_xlabel(), axes.get_zlabel()] if name == "spheres" else [])
        assert all(any(f"[{unit}]" in label for unit in ("g·m²", "rad/s", "rad/s²")) for label in labels), labels
    if name == "angular_velocity":
        assert figure.axes[-1].get_xlabel() == "time [s]"
    if name == "spheres":
        for axes in figure.axes:
            names = [label.split(":")[0] for label in (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel())]
            assert names == ["b1", "b2", "b3"]


def test_settings_stay_as_they_were():
    before = dict(matplotlib.rcParams)
    every_figure.__wrapped__()
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("name", ["$\\nonsense{$", "_hidden", "a_b", "<b>"])
def test_names_are_text_and_not_formulas(name, tmp_path):
    figure = contributions({name: statistics(0, 1)})
    figure.savefig(tmp_path / "figure.png")
    assert len(figure.legends[0].get_texts()) == 1


def test_one_trial_draws_nothing_but_does_not_fail(tmp_path):
    nothing = Statistics(np.zeros(6), *(np.full(6, np.nan) for _ in range(3)))
    contributions({"total": nothing}).savefig(tmp_path / "figure.png")
    contributions({f"{k}": nothing for k in range(7)}).savefig(tmp_path / "lines.png")
    plots.averages(campaign("T1", trials=1), "central").savefig(tmp_path / "average.png")
