"""An experiment as tables, in units: its body, trajectories, estimators and sources."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.signals.estimator_spec import EstimatorSpec
from uq.experiment.trajectory_table import TrajectorySpec
from uq.sources.source import KINDS, Source, on_axes
from uq.sources.source_table import WIDTHS

SOURCE_HEAD = ("source", "perturbs", "kind", "group", "σ on axes 1, 2, 3, or as named")


def body_table(
    mass: float | None, r_cg: np.ndarray | None, inertia: np.ndarray | None, r_cg_from_omb: np.ndarray, gravity: float
) -> Table:
    """Return mass [kg], centre of gravity [m], packed tensor [kg·m²] and gravity [m/s²], as far as they are stated."""
    lengths = {"from Q": r_cg, "from OMB": r_cg_from_omb}
    rows = [] if mass is None else [["mass", f"{_figure(mass)} kg"]]
    rows += [[f"CG {point}", f"{_figures(1e3 * r)} mm"] for point, r in lengths.items() if r is not None]
    if inertia is not None:
        rows.append(["inertia " + " ".join(COMPONENTS), f"{_figures(GRAM_METRE * inertia)} g·m²"])
    return Table("", ["body", ""], [*rows, ["gravity", f"{_figure(gravity)} m/s²"]])


def trajectory_table(trajectories: Mapping[str, TrajectorySpec]) -> Table:
    """Return what each trajectory is, for how long, at which rate."""
    rows = [
        [name, type(spec.trajectory).__name__.lower(), f"{_figure(spec.duration)} s", f"{_figure(spec.rate)} Hz",
         {"cg": "CG", "omb": "OMB"}[spec.still]]
        for name, spec in trajectories.items()
    ]  # fmt: skip
    return Table("", ["trajectory", "kind", "duration", "rate", "point that keeps still"], rows)


def estimator_table(estimators: Sequence[EstimatorSpec]) -> Table:
    """Return what each estimator does to the signals."""
    rows = [
        [e.name, e.differentiator, *(f"{_figure(hertz)} Hz" if hertz else "" for hertz in (e.band, e.lowpass))]
        for e in estimators
    ]
    return Table("", ["estimator", "differentiator", "band", "low-pass"], rows)


def source_table(sources: Sequence[Source], written: Mapping[str, Any] | None) -> Table:
    """Return what each source perturbs and how large it is.

    Args:
        sources: the sources.
        written: the experiment's content, whose words are repeated; None: it is of other values, these are shown in SI.
    """
    words = {source["name"]: size_of(source) for source in (written or {}).get("source", [])}
    rows = [[s.name, s.target, s.kind, s.group, words.get(s.name) or s.size] for s in sources]
    return Table("", SOURCE_HEAD, rows)


def left_out_note(names: Sequence[str]) -> list[str]:
    """Return what a result says of the sources that were left out; nothing where none was."""
    sources = ", ".join(name.replace("_", " ") for name in names)
    return [f"left out, so not in any figure: {sources}"] if sources else []


def size_of(source: Mapping[str, Any]) -> str:
    """Return how large a source is, in the words of its ``[[source]]``: ``sigma`` bare, other keys by their names."""
    kind_sizes = dict.fromkeys(key for kind in KINDS.values() for key in kind.sizes)
    sizes = []
    for key in (*WIDTHS, *kind_sizes, "distribution", "degrees_of_freedom", "mean"):
        if key in source and source[key] != "normal":
            value = source[key]
            matrix = isinstance(value, list) and isinstance(value[0], list)
            text = "6×6 matrix" if matrix else on_axes(value) if isinstance(value, list) else str(value)
            sizes.append(text if key == "sigma" else f"{key.replace('_', ' ')} {text}")
    return "; ".join(sizes)


def _figures(values: Any) -> str:
    return ", ".join(map(_figure, np.atleast_1d(np.asarray(values, float)).ravel()))


def _figure(value: float) -> str:
    return f"{value + 0.0:.6g}".replace("-", "−")
