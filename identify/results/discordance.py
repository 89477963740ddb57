"""Runs, or mountings, that leave the others of a pool, and the pool with and without them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from identify.display.rounding import with_uncertainty
from identify.least_squares.discordant import LEAST, discordant, misnamed
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component


class Discordant(NamedTuple):
    """A run, or a mounting with its runs, that leaves the others, in the component that departs most."""

    indices: tuple[int, ...]
    """Indices of the discordant runs among those of the result."""
    files: tuple[str, ...]
    mounting: str | None
    """Name of the discordant mounting; None: a run leaves the other runs of its mounting."""
    component: str
    difference: float
    """Difference from the weighted mean of those that belong [kg·m²]."""
    standard_uncertainty: float
    """Standard uncertainty of ``difference``, from residuals and sources that each mounting draws anew [kg·m²]."""

    @property
    def name(self) -> str:
        """The run's file, or the mounting with its runs."""
        files = ", ".join(self.files)
        return files if self.mounting is None else f"mounting {self.mounting} ({files})"

    @property
    def text(self) -> str:
        """Sentence on the departure and its size."""
        size, u = abs(self.difference), self.standard_uncertainty
        figures = f"{with_uncertainty(GRAM_METRE * size, GRAM_METRE * u)} g·m²"
        return f"{self.component} is {figures} ({size / u:.0f} u) {'above' if self.difference > 0 else 'below'} theirs"


class PoolEstimate(NamedTuple):
    """A pooled tensor of all that stood on the load cell. SI units."""

    runs: int
    inertia: np.ndarray
    standard_uncertainty: np.ndarray
    interval95: np.ndarray

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m²."""
        return {
            "runs": self.runs,
            "inertia": by_component(self.inertia),
            "standard_uncertainty": by_component(self.standard_uncertainty),
            "interval95": by_component(self.interval95),
        }


@dataclass(frozen=True)
class Discordance:
    """The runs that leave the others, and the pool with and without them."""

    departures: tuple[Discordant, ...]
    all_runs: PoolEstimate
    """Estimate from all runs, which is the result."""
    without: PoolEstimate | None
    """Estimate from the runs that belong; None: these alone do not determine the tensor."""

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m²."""
        return {
            "departures": [
                {"runs": list(departure.files)} | {name: getattr(departure, name) for name in RECORDED}
                for departure in self.departures
            ],
            "with": self.all_runs.to_dict(),
            "without": None if self.without is None else self.without.to_dict(),
        }

    @property
    def warnings(self) -> list[str]:
        """A line for each run or mounting that leaves the others."""
        return [f"{d.name} disagrees with the others: {d.text}{self._of_pool(d)}; {CURE}" for d in self.departures]

    def _of_pool(self, departure: Discordant) -> str:
        if self.without is None:
            return ""
        at = COMPONENTS.index(departure.component)
        reduced, full = (
            with_uncertainty(GRAM_METRE * pool.inertia[at], GRAM_METRE * u)
            for pool in (self.without, self.all_runs)
            for u in [pool.standard_uncertainty[at]]
        )
        return f", and the pool's {departure.component} is {reduced} without {self._them()} instead of {full} g·m²"

    def _them(self) -> str:
        return "it" if len(self.departures) == 1 else f"these {len(self.departures)}"


RECORDED = ("mounting", "component", "difference", "standard_uncertainty")
"""Properties of a departure in result.json, beside its runs."""
MISNAMED = "they are left out: correct them, or name none"
"""The fate of wrong names, and their cure."""
CURE = "find out what was different, and leave it out only for a reason"


def discordant_runs(runs: Sequence[RunEstimate], redrawn: np.ndarray) -> tuple[Discordant, ...]:
    """Return the mountings that leave the others, and the runs that leave the others of their mounting.

    Only runs that identify the whole tensor by themselves are judged; where fewer than two mountings are named, all
    runs are of one.

    Args:
        runs: of a result.
        redrawn: standard uncertainty of one mounting's tensor from sources that each mounting draws anew [kg·m²].
    """
    alone = [index for index, run in enumerate(runs) if run.alone]
    labels = list(dict.fromkeys(runs[index].mounting for index in alone))
    clusters = [[index for index in alone if runs[index].mounting == label] for label in labels]
    leaving = _leaving(runs, clusters, labels, redrawn)
    for cluster in clusters:
        leaving += _leaving(runs, [[index] for index in cluster], [None] * len(cluster), np.zeros(6))
    return tuple(leaving)


def misnamed_mountings(runs: Sequence[RunEstimate], freedom: float) -> str:
    """Return a warning where runs of one name differ beyond their noise, and no less than runs of different names.

    Empty where they do not. Compared are tensors of runs that identify all of it, and where runs have them, r_CG.

    Args:
        runs: of a result.
        freedom: degrees of freedom of their standard uncertainties.
    """
    alone = [run for run in runs if run.alone]
    names = [str(run.mounting) for run in alone]
    if len(set(names)) < 2:
        return ""
    values = np.array([np.concatenate([run.inertia, run.r_cg]) for run in alone])
    u = np.array([np.concatenate([run.standard_uncertainty, run.sigma_r_cg]) for run in alone])
    wrong = misnamed(values, u, names, freedom)
    if wrong is None:
        return ""
    quantity = (*COMPONENTS, *(f"r_CG on b{axis}" for axis in (1, 2, 3)))[wrong.quantity]
    doubt = "" if wrong.certain else ", or find out what else changes from run to run"
    return (
        f"the names of the mountings do not match the scatter: {quantity} scatters {wrong.within:.1f} times more "
        f"between runs of one name than within a run, and between names {wrong.across:.2g} times as much as that; "
        f"{MISNAMED}{doubt}"
    )


def _leaving(
    runs: Sequence[RunEstimate], groups: Sequence[Sequence[int]], mountings: Sequence[str | None], redrawn: np.ndarray
) -> list[Discordant]:
    """Groups of runs, by their indices, whose mean tensor leaves those of the others."""
    if len(groups) < LEAST:
        return []
    values, u = (np.array(part) for part in zip(*(_weighted_mean(runs, group) for group in groups), strict=True))
    return [
        Discordant(
            indices=tuple(groups[k]), files=tuple(runs[index].file for index in groups[k]), mounting=mountings[k],
            component=COMPONENTS[component], difference=difference, standard_uncertainty=uncertainty,
        )
        for k, component, difference, uncertainty in discordant(values, np.hypot(u, redrawn))
    ]  # fmt: skip


def _weighted_mean(runs: Sequence[RunEstimate], cluster: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Mean tensor of some runs and its standard uncertainty from their residuals [kg·m²]."""
    weight = np.array([np.maximum(runs[index].standard_uncertainty, 1e-300) ** -2 for index in cluster])
    values = np.array([runs[index].inertia for index in cluster])
    return (weight * values).sum(axis=0) / weight.sum(axis=0), weight.sum(axis=0) ** -0.5
