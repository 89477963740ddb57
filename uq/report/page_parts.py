"""The tables, figures and findings that reports are made of."""

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Any
from urllib.parse import quote

import numpy as np
from matplotlib.figure import Figure

from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.text_tables import decimals, fixed, is_figure, with_error
from uq.barreto2016 import PRINTED, PaperResult
from uq.campaign.campaign import GRAM_METRE, Breakdown, MonteCarloResult, Statistics
from uq.experiment.experiment import PRESETS, Experiment
from uq.figures import campaign_figures as plots
from uq.report.certificate_front import Front


@dataclass(frozen=True)
class Table:
    """A table of a report."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    wrap: bool = False
    """Whether its cells hold text that may be broken into lines."""

    @property
    def numeric(self) -> list[bool]:
        """Which columns hold figures, to be set to the right."""
        return [all(is_figure(row[k]) for row in self.rows) for k in range(len(self.head))]


@dataclass(frozen=True)
class Drawing:
    """A figure of a report."""

    name: str
    """Stem of its files."""
    figure: Figure
    caption: str
    moving: bytes = b""
    """An SVG that moves, in place of the figure's own; empty: the figure stands for itself."""

    @property
    def wide(self) -> bool:
        """Whether it takes the width of a page rather than of a column."""
        return bool(self.figure.get_figwidth() > plots.COLUMN)


@dataclass(frozen=True)
class Page:
    """The content of a report, in the order in which it is read."""

    title: str
    computed: Sequence[str]
    """What was computed, a paragraph each."""
    findings: Sequence[str]
    """What a reader must not miss: warnings, failures, mean errors beyond the dispersion."""
    tables: Sequence[Table]
    figures: Sequence[Drawing]
    details: Sequence[Table]
    """Tables that follow the figures."""
    assumptions: Sequence[str]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    front: Front | None = None
    """What makes it a certificate; None: it is another report."""


def summary(result: MonteCarloResult) -> Table:
    """Return the table of totals: mean error and 3σ of each component with standard errors."""
    head, rows = result.rows()
    return Table("All sources together, g·m²", [*head[:2], "", *head[3:]], rows)


def nominal(result: MonteCarloResult) -> Table:
    """Return the table of the true tensor."""
    return Table("True tensor, g·m²", list(COMPONENTS), [[_typeset(f"{GRAM_METRE * v:.6g}") for v in result.nominal]])


def coverage_tables(result: MonteCarloResult) -> list[Table]:
    """Return the tables of coverage intervals and, of an adaptive campaign, of what was asked and reached."""
    (head, rows), note = result.interval_rows(), "symmetric: as much on either side; shortest: JCGM 101, 7.7."
    tables = [Table("95 % coverage intervals of the error, g·m²", [*head[:2], "", *head[3:]], rows, note)]
    if result.stability is not None:
        head, rows = result.tolerance_rows()
        note = "tolerance: half a unit of the last significant digit of u, or as asked; JCGM 101, 7.9."
        tables.append(Table("Adaptive Monte Carlo, g·m²", [*head[:2], "", *head[3:]], rows, note))
    return tables


def breakdown_table(result: MonteCarloResult, trajectory: str, estimator: str) -> Table:
    """Return the table of one breakdown: every group and source, its mean error, 3σ and share."""
    breakdown, rows = result[trajectory, estimator], []
    for name, statistics in {**breakdown.groups, **breakdown.sources}.items():
        first, second = _two_rows((plots.display_name(name),), statistics)
        rows += [[*first, ""], [*second, _share(breakdown, name)]]
    head = ["alone", "", *COMPONENTS, "share %"]
    note = "share: 3σ alone over the total's, averaged over the components."
    return Table(f"{trajectory}, {estimator}: groups and sources alone, g·m²", head, rows, note)


def _share(breakdown: Breakdown[Statistics], name: str) -> str:
    with np.errstate(invalid="ignore", divide="ignore"):
        share = 100 * breakdown.share(name)
    return f"{round(share, 6):.3g}" if np.isfinite(share) else "–"


def _two_rows(first: tuple[str, ...], s: Statistics) -> list[list[str]]:
    mean = map(with_error, GRAM_METRE * s.mean_error, GRAM_METRE * s.mean_error_standard_error)
    sigma = map(with_error, GRAM_METRE * s.three_sigma, GRAM_METRE * s.three_sigma_standard_error)
    return [[*first, "mean error", *mean], [*("" for _ in first), "3σ", *sigma]]


def run_table(result: Identification) -> Table:
    """Return the table of runs: each one's own estimate, samples, rate, residuals."""
    head = ["run", "samples", "rate, Hz", "residual, N·m", *COMPONENTS]
    rows = []
    for run in result.runs:
        pairs = zip(run.inertia - result.taken_off, run.standard_uncertainty, strict=True)
        values = [fixed(GRAM_METRE * x, decimals(GRAM_METRE * u)) if run.alone else "–" for x, u in pairs]
        residual = f"{float(np.sqrt(np.mean(run.residual**2))):.3g}"
        rows.append([run.file, f"{run.samples}", f"{run.rate:.6g}", residual, *values])
    note = "Each run alone; –: it does not identify the whole tensor. The files' hashes stand under Provenance."
    return Table("Runs, components in g·m²", head, rows, note)


def input_table(provenance: Mapping[str, Any]) -> Table:
    """Return the table of every file that went into a result, with its SHA-256, wherever its provenance names it."""
    rows = list(dict.fromkeys(_named_files(provenance)))
    return Table("Inputs", ["file", "SHA-256"], rows, wrap=True)


def _named_files(content: object) -> Iterator[tuple[str, str]]:
    if isinstance(content, Mapping):
        if isinstance(content.get("file"), str) and isinstance(content.get("sha256"), str):
            yield content["file"], content["sha256"]
        content = list(content.values())
    if isinstance(content, (list, tuple)):
        for item in content:
            yield from _named_files(item)


SIZES = (
    "sigma", "half_width", "scale", "datasheet", "samples", "white", "flicker", "random_walk", "limit", "step",
    "distribution", "degrees_of_freedom", "mean",
)  # fmt: skip
"""Keys of a source that say how large it is."""


def source_tables(provenance: Mapping[str, Any]) -> list[Table]:
    """Return the tables of error sources, with their references, and of inferred values."""
    document = provenance.get("experiment") or {}
    rows = [
        [s["name"], s["target"], s["kind"], s["group"], size_of(s), s.get("reference", "not given")]
        for s in document.get("source", [])
    ]
    guesses = inferred(document)
    tables = [
        Table(
            "Error sources",
            ["source", "perturbs", "kind", "group", "σ on axes 1, 2, 3, or as named", "reference"],
            rows,
        )
    ]
    note = "Not stated by the source; found as the values that reproduce its Table 2."
    inferences = [Table("Inferred values", ["key", "value", "reason"], guesses, note)]
    return [*(tables if rows else []), *(inferences if guesses else [])]


def size_of(source: Mapping[str, Any]) -> str:
    """Return how large a source is, in the words of its ``[[source]]``: ``sigma`` bare, other keys by their names."""
    said = []
    for key in SIZES:
        if key in source and source[key] != "normal":
            value = source[key]
            matrix = isinstance(value, list) and isinstance(value[0], list)
            text = "6×6 matrix" if matrix else ", ".join(value) if isinstance(value, list) else str(value)
            said.append(text if key == "sigma" else f"{key.replace('_', ' ')} {text}")
    return "; ".join(said)


def inferred(document: Mapping[str, Any]) -> list[list[str]]:
    """Return key, value and reason of the values that a preset's file marks INFERRED; none for any other document."""
    for name in PRESETS:
        text = resources.files("uq").joinpath("presets", f"{name}.toml").read_text("utf-8")
        if tomllib.loads(text) == document:
            return _marked(text)
    return []


def _marked(text: str) -> list[list[str]]:
    rows, where = [], ""
    for line in text.splitlines():
        if header := re.match(r"\[+([^\]]+)\]+", line):
            where = header[1]
        elif mark := re.match(r"(\w+) *= *(.*?) *# INFERRED:? *(.*)", line):
            rows.append([f"{where}.{mark[1]}", mark[2].replace('"', "").strip("[]"), mark[3]])
    return rows


def breakdown_figures(result: MonteCarloResult, trajectory: str, estimator: str) -> list[Drawing]:
    """Return the figures of one breakdown: by group, and by source."""
    breakdown = result[trajectory, estimator]
    of = f"{trajectory}, {estimator}"
    by_source = {"total": breakdown.total, **breakdown.sources}
    return [
        Drawing(
            stem("groups", trajectory, estimator),
            plots.contributions(breakdown.groups),
            f"{of}: 3σ and mean error of each component, all sources and each group alone.",
        ),
        Drawing(
            stem("sources", trajectory, estimator),
            plots.contributions(by_source),
            f"{of}: 3σ and mean error of each component, all sources and each source alone.",
        ),
    ]


def stem(*names: str) -> str:
    """Return a file's stem made of names: no two alike, and no character that leads out of the folder."""
    return "-".join(quote(name, safe="") for name in names)


def paper_figures(result: PaperResult) -> list[Drawing]:
    """Return the source's figures 2 to 5, the last two kinds for each estimator."""
    campaign = result.campaign
    trajectories = Experiment.from_dict(campaign.provenance["experiment"]).trajectories
    _, *sphere = plots.rates(trajectories["T1"])
    t, omega, _ = plots.rates(trajectories["T3"])
    simple = plots.angular_velocity(t, omega)
    return [
        Drawing(
            "figure2-spheres",
            plots.spheres(*sphere),
            "Figure 2. Angular velocity and acceleration of T1 in the body frame.",
        ),
        *(
            Drawing(
                stem("figure3", "groups", "T1", name),
                plots.contributions(campaign["T1", name].groups),
                f"Figure 3, estimator {name}. T1: 3σ and mean error, all sources and each group alone.",
            )
            for name in result.estimators
        ),
        Drawing("figure4-simple-motions", simple, "Figure 4. Angular velocity of the simple harmonic motions (T3)."),
        *(
            Drawing(
                stem("figure5", "trajectories", name),
                plots.averages(campaign, name, PRINTED),
                f"Figure 5, estimator {name}. Average 3σ of moments and products beside the source's, and average "
                "magnitude of the mean errors, which the source does not print.",
            )
            for name in result.estimators
        ),
    ]


def _typeset(number: str) -> str:
    return number.replace("-", "−")
