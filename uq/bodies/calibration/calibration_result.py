"""The result of a calibration: the rig's errors, the file of sources that declares them, and what was found wrong."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.display.reporting import Result
from identify.known_bodies import Doubt
from uq.files.provenance import plain_values
from uq.sources.draw_figures import part_of
from uq.sources.kinds.cross_talk import UNITS
from uq.sources.source import Source

NARROWER = 0.9
"""Standard uncertainty over that before the runs, below which a number counts as determined, and its error is written.

Choice: what remains of the others is what the experiment says of them, or a typical size.
"""
GOES_ALONG = 0.3
"""Correlation with an error that is written above which another one is written, too."""
ROUNDING = 1e-9
"""Part of a correlation matrix that is the unit matrix, so that rounding leaves no negative eigenvalue."""


class CalibratedError(NamedTuple):
    """One error of load cell or IMU, before and after the runs; SI."""

    source: Source
    prior: Float[np.ndarray, " n"]
    """Standard uncertainty of each of its numbers before the runs."""
    mean: Float[np.ndarray, " n"]
    standard_uncertainty: Float[np.ndarray, " n"]
    distance: Float[np.ndarray, " n"]
    """Distance of each from its prior mean, in what chance scatters it by; 0 where the runs do not tell it."""

    @property
    def determined(self) -> bool:
        """Whether the runs determine any of its numbers."""
        return bool((self.standard_uncertainty < NARROWER * self.prior).any())


@dataclass(frozen=True, repr=False)
class Calibration(Result):
    """Errors of a rig by runs of known bodies.

    Example: ``calibrate_files([("cylinder.toml", runs)], experiment).sources()``.
    """

    errors: tuple[CalibratedError, ...]
    covariance: Float[np.ndarray, "n n"]
    """Covariance of the numbers of all errors, in their order; SI."""
    departure: float
    """Chi-squared of the errors that the runs determine, under their priors."""
    directions: int
    """Degrees of freedom of ``departure``."""
    chance: float
    """Probability of so large a departure where priors and bodies are right."""
    scatter: float
    """Ratio of the scatter between runs to that which their noise predicts."""
    doubts: tuple[Doubt, ...]
    """Parameters of the known body that may be wrong instead."""
    group: str
    """Group of the sources that :meth:`sources` writes."""
    about: Mapping[str, Any]
    """Table ``[[calibration]]`` of the file: days, runs, instruments."""
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    name: str = "calibration"
    kind = "inertia calibrate"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def written(self) -> list[int]:
        """Return the places of the errors that the runs determine, and of those that go along with them."""
        blocks = self._places()
        u = np.sqrt(np.diag(self.covariance))
        correlation = np.abs(self.covariance) / np.maximum(np.outer(u, u), 1e-300)
        chosen = [k for k, error in enumerate(self.errors) if error.determined]
        along = [
            k for k, block in enumerate(blocks)
            if k not in chosen
            and any(correlation[block, blocks[other]].max(initial=0) > GOES_ALONG for other in chosen)
        ]  # fmt: skip
        return sorted(chosen + along)

    def _places(self) -> list[slice]:
        ends = np.cumsum([0, *(len(error.mean) for error in self.errors)]).tolist()
        return [slice(start, end) for start, end in itertools.pairwise(ends)]

    def sources(self) -> dict[str, Any]:
        """Return the content of a file that an experiment includes: the errors' means, sizes and correlations."""
        chosen, blocks = self.written(), self._places()
        names = [f"{self.group}_{number}_{self.errors[k].source.name}" for number, k in enumerate(chosen, 1)]
        tables, links = [], []
        for name, k in zip(names, chosen, strict=True):
            tables.append(self._table(name, self.errors[k], self._correlation(blocks[k], blocks[k])))
        for number, k in enumerate(chosen):
            for other in range(number):
                coefficient = self._correlation(blocks[k], blocks[chosen[other]])
                if coefficient.any():
                    links.append({"sources": [names[number], names[other]], "coefficient": coefficient.tolist()})
        about = {"group": self.group, **self.about, "warnings": list(self.warnings)}
        return {"calibration": [about], "source": tables} | ({"correlation": links} if links else {})

    def _correlation(self, rows: slice, columns: slice) -> np.ndarray:
        u = np.sqrt(np.diag(self.covariance))
        scale = np.outer(u[rows], u[columns])
        same = np.arange(len(u))[rows][:, None] == np.arange(len(u))[columns]
        ratio = np.divide(self.covariance[rows, columns], scale, out=np.zeros_like(scale), where=scale > 0)
        return np.where(same, 1.0, (1 - ROUNDING) * np.clip(ratio, -1, 1))

    def _table(self, name: str, error: CalibratedError, correlation: np.ndarray) -> dict[str, Any]:
        source = error.source
        table: dict[str, Any] = {"name": name, "target": source.target, "kind": source.kind, "group": self.group}
        table |= {"reference": self.title()}
        shape = np.shape(source.sigma)
        for key, values in (("mean", error.mean), ("sigma", error.standard_uncertainty)):
            table[key] = _written(values.reshape(shape), units_of(source))
        return table | ({"correlation": correlation.tolist()} if shape else {})

    def records(self) -> list[dict[str, Any]]:
        """Return each number of each error, before and after the runs, in SI."""
        return [
            {"error": error.source.name, "target": error.source.target, "kind": error.source.kind, "number": str(k + 1)}
            | {"prior": float(prior), "mean": float(mean), "standard_uncertainty": float(u)}
            for error in self.errors
            for k, (prior, mean, u) in enumerate(zip(error.prior, error.mean, error.standard_uncertainty, strict=True))
            if prior > 0
        ]

    def title(self) -> str:
        """Return what the tables are of."""
        bodies = dict.fromkeys(run["body"] for run in self.about["run"])
        count = len(self.about["run"])
        return f"Calibration of the rig by {', '.join(bodies)}, {count} run{'s' * (count > 1)}"

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json."""
        return {
            **self.form(), "errors": self.records(), "departure": self.departure, "directions": self.directions,
            "chance": self.chance, "scatter_between_runs": self.scatter,
            "doubts": [doubt._asdict() for doubt in self.doubts], "calibration": plain_values(dict(self.about)),
            "warnings": list(self.warnings), "assumptions": list(self.assumptions),
            "provenance": plain_values(self.provenance),
        }  # fmt: skip


def units_of(source: Source) -> np.ndarray:
    """Return the unit of each number of a source, in the shape of its draw."""
    shape = np.shape(source.sigma)
    return np.array(UNITS) if shape == (6, 6) else np.full(shape, source.error_kind.figures(source.target).unit)


def _written(values: Any, units: Any) -> Any:
    """Figures in their units as TOML has them."""
    if not np.ndim(values):
        return f"{values / part_of(str(units)):.9g} {units}"
    return [_written(value, unit) for value, unit in zip(values, units, strict=True)]
