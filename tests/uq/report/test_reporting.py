"""Results as figures, frames and views."""

import dataclasses
import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from matplotlib.figure import Figure

import identify
import uq
from identify.display.reporting import Result
from identify.display.views import part_of_view
from tests.helpers.pose_lab import series
from tests.helpers.small_campaign import campaign
from tests.helpers.weighing import Weighed, weighing
from uq.analysis.propagation.law_of_propagation import propagate
from uq.report.figures.style import legend_above, stacked
from uq.report.views import VIEWS
from uq.sources.distributions import Normal


def test_a_legend_is_read_row_by_row_and_names_what_is_seen():
    """In the order of the bars; a part thinner than a line is in the tables alone."""
    figure = Figure(figsize=(3.5, 2), layout="constrained")
    parts = [(f"the source {k}", "#0072B2", np.array([share])) for k, share in enumerate((40.0, 30.0, 20.0, 9.9, 0.1))]
    stacked(figure.subplots(), parts, 0.7)
    legend_above(figure)
    (legend,) = figure.legends
    figure.draw_without_rendering()
    places = {text.get_text(): text.get_window_extent() for text in legend.get_texts()}
    rows = sorted(places, key=lambda name: (-round(places[name].y0), places[name].x0))
    assert len({round(place.y0) for place in places.values()}) == 2
    assert rows == [f"the source {k}" for k in range(4)]


@pytest.fixture
def weighed():
    return weighing()


def test_a_figure_is_drawn_into_another_one():
    """In the place of an axes, or in a subfigure: the same panels with the same curves as the figure of its own."""
    figures = campaign().figures()
    panels = [len(axes.collections) for axes in figures["breakdown-T1-central"].axes]
    assert min(panels) > 2
    whole = Figure(layout="constrained")
    left, right = whole.subplots(1, 2)
    right.plot([0, 1])
    drawn = figures.draw("breakdown-T1-central", ax=left)
    assert [len(axes.collections) for axes in drawn.axes] == panels
    assert whole.axes == [right, *drawn.axes]  # the empty axes made room
    whole.draw_without_rendering()
    assert max(axes.get_window_extent().x1 for axes in drawn.axes) < right.get_window_extent().x0
    top, _ = Figure(layout="constrained").subfigures(2, 1)
    assert figures.draw("breakdown-T1-central", ax=top) is top
    assert [len(axes.collections) for axes in top.axes] == panels
    assert isinstance(figures["breakdown-T1-smoothed"], Figure)  # again one of its own


def test_frames_hold_the_numbers_by_name():
    result = campaign()
    row = result.to_frame().loc[("T1", "central", "imu", "I33")]
    assert row["mean_error [kg·m²]"] == result["T1", "central"].groups["imu"].mean_error[5]
    centre = series(np.random.default_rng(0))
    assert centre.to_frame().loc[("cg_y", "m"), "standard_uncertainty"] == centre.standard_uncertainty[2]
    law = propagate(lambda x: x["a"] * x["b"], {"a": Normal(1.0, 0.1), "b": Normal(2.0, 0.3)})
    assert law.to_frame()["u from b"][0] == pytest.approx(0.3)
    assert Weighed(2.0, np.ones(1)).to_frame().loc["mass", "kg"] == "2"  # texts alone: the first names the row


def results():
    """Every result of both packages."""
    for package in (identify, uq):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    found = [Result]
    for kind in found:
        found += kind.__subclasses__()
    return [kind for kind in found if kind.__module__.split(".")[0] in ("identify", "uq") and kind is not Result]


def test_no_result_shows_itself_in_a_way_of_its_own():
    kinds = [kind for kind in results() if not inspect.isabstract(kind)]
    assert len(kinds) >= 20
    for kind in kinds:
        assert dataclasses.is_dataclass(kind)
        assert kind.__repr__ is Result.__repr__, kind
        assert kind._repr_html_ is Result._repr_html_, kind
        assert kind.tables is not Result.tables or part_of_view(kind, "tables") is not None, kind
        assert "Example: ``" in (kind.__doc__ or ""), kind
        assert kind.records is not Result.records, kind


def test_a_summary_is_title_verdict_and_first_tables(weighed):
    """Of every result: `Result.summary` alone writes it."""
    result = campaign()
    title, verdict, caption, *rows = result.summary().splitlines()
    assert (title, verdict) == (result.title(), result.section().verdict)
    assert "\n".join([caption, *rows]) == repr(result.section().tables[0])
    assert weighed.summary() == f"{weighed.title()}\n{weighed.tables()[0]}"
    assert all(kind.summary is Result.summary for kind in results())


def test_every_registered_view_is_of_a_type_that_there_is():
    for name in VIEWS:
        kind = pkgutil.resolve_name(name)
        assert kind.__module__ == name.rpartition(".")[0]
        assert part_of_view(kind, "tables") is not None, name


def test_a_subclass_has_the_view_of_its_base_unless_it_has_methods_of_its_own(weighed):
    class Heavier(type(campaign())):
        def notes(self):
            return ["heavier"]

    result = campaign()
    heavier = Heavier(**{f.name: getattr(result, f.name) for f in dataclasses.fields(result)})
    assert heavier.title() == result.title()
    assert heavier.notes() == ["heavier"]
    assert part_of_view(Weighed, "tables") is None
