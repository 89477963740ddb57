"""The budget of one estimator on one trajectory: shares of the variance, mean errors, the split of the mean square."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from identify.reporting import Shown
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import finest, with_uncertainty
from identify.text_tables import Table
from uq.campaign.statistics import Statistics
from uq.sensitivity.variance_shares import Indices

TENSOR = "tensor"
"""Name of the whole tensor among the components."""
COLUMNS = (*COMPONENTS, TENSOR)
FEWEST_PAIRS, FEW_PAIRS = 4, 50
"""Pairs of trials below which there are no standard errors, and below which a finding calls them too small: two of them
hold the share 92 times in a hundred of 50 pairs, 87 of 10, 84 of 4."""
CLOSURE_LIMIT = 4
"""Standard errors beyond which a budget's closure is reported as off."""


class Effects(NamedTuple):
    """Effects of each player (a source or a group) on each component and on the whole tensor."""

    players: tuple[str, ...]
    first: Indices
    """Share of the variance that the player causes by itself, ``Var E[I | X_p] / Var I``."""
    total: Indices
    """Share of the variance that the player causes with its interactions, ``E Var[I | all but X_p] / Var I``."""
    shapley: Indices
    """Shapley effect of the player: interactions are divided in equal parts, and the shares add up to one."""
    alone: Mapping[str, Statistics]
    """Mean error and 3σ with the others off, by player."""


class MeanSquare(NamedTuple):
    """All sources together: how much of the mean squared error is bias and how much dispersion."""

    mean_error: np.ndarray
    """Mean error by component [kg·m²]."""
    mean_error_standard_error: np.ndarray
    variance: np.ndarray
    """Variance by component [(kg·m²)²]."""
    variance_standard_error: np.ndarray
    bias_share: np.ndarray
    """Square of the mean error over the mean squared error, by component; the rest is dispersion."""
    bias_share_standard_error: np.ndarray
    tensor_bias_share: float
    """Square of the mean error over the mean squared error, for the whole tensor."""
    tensor_bias_share_standard_error: float


@dataclass(frozen=True, repr=False)
class SourceBudget(Shown):
    """The budget of one estimator on one trajectory."""

    sources: Effects
    groups: Effects
    without: np.ndarray
    """The estimator's error with all sources off, by component [kg·m²]."""
    mean_square: MeanSquare
    closure: np.ndarray
    """Variance that the Shapley effects share out over the ordinary sample variance of the estimates, by component."""
    closure_standard_error: np.ndarray
    """Standard error of a closure of one: its distance from one by chance alone."""
    failed: int
    """Pairs of trials in which some case could not be solved; they are left out."""

    @property
    def culprit(self) -> str:
        """The source with the largest Shapley share of the whole tensor."""
        return self.sources.players[int(np.nanargmax(np.nan_to_num(self.sources.shapley.generalised, nan=-1)))]

    @property
    def verdict(self) -> str:
        """The culprit, and how much of the error is bias, in a sentence."""
        shapley, p = self.sources.shapley, self.sources.players.index(self.culprit)
        share = _percent(shapley.generalised[p], shapley.generalised_standard_error[p])
        m = self.mean_square
        bias = _percent(m.tensor_bias_share, m.tensor_bias_share_standard_error)
        alone = {name: float(np.nansum(s.mean_error**2)) for name, s in self.sources.alone.items()}
        worst = max(alone, key=lambda name: alone[name])
        return (
            f"{_name(self.culprit)} causes {share} % of the tensor's variance; {bias} % of its mean squared error is "
            f"bias{f', most of it from {_name(worst)}' if m.tensor_bias_share > 0.05 else ''}."
        )

    @property
    def closes(self) -> bool:
        """Whether the closure is one within :data:`CLOSURE_LIMIT` standard errors on every component."""
        return not bool((np.abs(self.closure - 1) > CLOSURE_LIMIT * self.closure_standard_error).any())

    def tables(self) -> list[Table]:
        """Return the shares of the whole tensor's variance."""
        return [Table("", *self.tensor_rows())]

    def notes(self) -> list[str]:
        """Return the verdict."""
        return [self.verdict]

    def tensor_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the shares of the whole tensor's variance, in per cent, the largest first."""
        rows = []
        for label, effects in self._kinds():
            kinds = (effects.first, effects.total, effects.shapley)
            small = 0
            for p in _by_size(effects):
                if not label and max(abs(i.generalised[p]) for i in kinds) < SMALL:
                    small += 1
                    continue
                cells = [_percent(i.generalised[p], i.generalised_standard_error[p]) for i in kinds]
                rows.append([f"{label}{_name(effects.players[p])}", *cells])
            if small:
                rows.append([f"{small} more, below {100 * SMALL:g} each", "", "", ""])
            if not label:
                rows.append(["sum of sources", *(_percent(i.sum[1], np.nan) for i in kinds)])
        return ["% of the tensor's variance", "first order", "total", "Shapley"], rows

    def component_rows(self, quantity: str = "shapley") -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the shares of each component's variance: ``first``, ``total`` or ``shapley``."""
        rows = []
        for label, effects in self._kinds():
            indices = getattr(effects, quantity)
            for p in _by_size(effects):
                cells = map(_percent, indices.value[p], indices.standard_error[p])
                rows.append([f"{label}{_name(effects.players[p])}", *cells])
            if not label:
                rows.append(["sum of sources", *(_percent(value, np.nan) for value in indices.sum[0])])
        rows.append(["closure", *map(_percent, self.closure, self.closure_standard_error)])
        title = {"first": "first order", "total": "total", "shapley": "Shapley"}[quantity]
        return [f"{title}, % of the variance", *COMPONENTS], rows

    def mean_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the mean errors, g·m²: each source and group alone, and all together."""
        m = self.mean_square
        places = finest(GRAM_METRE * m.mean_error_standard_error)
        rows = [
            [f"{label}{_name(name)}", *_grams(s.mean_error, s.mean_error_standard_error, places), ""]
            for label, effects in self._kinds()
            for name, s in effects.alone.items()
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            spread = np.where(m.variance > 0, 1.5 * m.variance_standard_error / np.sqrt(m.variance), 0.0)
        shares = [*m.bias_share, m.tensor_bias_share]
        errors = [*m.bias_share_standard_error, m.tensor_bias_share_standard_error]
        return ["mean error alone, g·m²", *COLUMNS], [
            ["no source: the estimator", *_grams(self.without, np.zeros(len(COMPONENTS)), places), ""],
            *rows,
            ["all sources", *_grams(m.mean_error, m.mean_error_standard_error, places), ""],
            ["3σ of all sources", *_grams(3 * np.sqrt(m.variance), spread, places), ""],
            ["bias, % of the mean square", *map(_percent, shares, errors)],
        ]

    def _kinds(self) -> tuple[tuple[str, Effects], tuple[str, Effects]]:
        return ("", self.sources), ("group ", self.groups)

    def values(self) -> Iterator[tuple[str, str, str, str, float, float, str]]:
        """Yield kind of player, player, component, quantity, value, standard error and unit of every figure."""
        for kind, effects in (("source", self.sources), ("group", self.groups)):
            for quantity in ("first", "total", "shapley"):
                indices = getattr(effects, quantity)
                values = np.column_stack([indices.value, indices.generalised])
                errors = np.column_stack([indices.standard_error, indices.generalised_standard_error])
                for p, name in enumerate(effects.players):
                    for column, value, error in zip(COLUMNS, values[p], errors[p], strict=True):
                        yield kind, name, column, quantity, value, error, "1"
            for name, s in effects.alone.items():
                for quantity in ("mean_error", "three_sigma"):
                    values, errors = (GRAM_METRE * getattr(s, quantity + end) for end in ("", "_standard_error"))
                    for column, value, error in zip(COMPONENTS, values, errors, strict=True):
                        yield kind, name, column, f"{quantity}_alone", value, error, "g*m^2"
        yield from self._of_all()

    def _of_all(self) -> Iterator[tuple[str, str, str, str, float, float, str]]:
        m, square = self.mean_square, GRAM_METRE**2
        for k, column in enumerate(COMPONENTS):
            mean = GRAM_METRE * m.mean_error[k], GRAM_METRE * m.mean_error_standard_error[k]
            yield "all", "all", column, "mean_error", *mean, "g*m^2"
            of_variance = square * m.variance[k], square * m.variance_standard_error[k]
            yield "all", "all", column, "variance", *of_variance, "(g*m^2)^2"
            yield "all", "all", column, "bias_share", m.bias_share[k], m.bias_share_standard_error[k], "1"
            yield "all", "all", column, "closure", self.closure[k], self.closure_standard_error[k], "1"
        yield "all", "all", TENSOR, "bias_share", m.tensor_bias_share, m.tensor_bias_share_standard_error, "1"


def _by_size(effects: Effects) -> list[int]:
    """Numbers of the players, the one with the largest share of the tensor's variance first."""
    return sorted(range(len(effects.players)), key=lambda p: -effects.shapley.generalised[p])


def _name(name: str) -> str:
    return name.replace("_", " ").replace("omega", "ω").replace("r cg", "r CG")


SMALL = 5e-4
"""Share of the tensor's variance below which sources are counted together; budget.csv holds all."""


def _percent(value: float, standard_error: float) -> str:
    """A share in per cent, to a thousandth at most."""
    return with_uncertainty(100 * value, 100 * standard_error, places=3)


def _grams(values: np.ndarray, errors: np.ndarray, places: int) -> list[str]:
    return list(map(with_uncertainty, GRAM_METRE * values, GRAM_METRE * errors, [places] * len(values)))
