"""The ledger of a result: one row an error, and every figure of uncertainty as a function of the rows.

Linear rows hold the changes by one standard uncertainty of independent numbers, so that covariances are sums of
``changes @ changes.T`` and positive semidefinite by construction. Rows that are drawn hold errors of one set of trials
(JCGM 101), which add trial by trial.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.display.reporting import Shown
from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.pooling import Pooling
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import PARAMETERS, by_component

QUANTITIES = (
    ("the mass", "g", 1e3),
    *((f"the centre of gravity on b{axis}", "mm", 1e3) for axis in (1, 2, 3)),
    *((name, "g·m²", GRAM_METRE) for name in COMPONENTS),
)
"""The ten parameters as they are said: name, unit, that unit's number in one of SI."""
USUAL = 0.95
"""Coverage probability of the intervals that results hold."""
CONVENTIONAL = 2.0
"""Coverage factor of errors whose size is no measurement: what the runs contradict, and typical sizes.

Convention: such figures are known to 30 to 50 %, so that no factor has a coverage probability.
"""
LARGEST_SHARE = 1 / 3
"""u of undeclared errors over u above which a result depends on what nobody declared: a third makes u 5 % larger, which
two digits hardly show."""
SEED = 0
"""Seed of the draws of declared errors, and of the order of the quantiles that join them."""

FIXTURE = "fixture taken off"
"""Name of what a fixture that is taken off adds."""
Tier = Literal["measured", "declared", "contradicted", "typical"]
"""Origin of a figure: what the runs show (type A); what is declared; what the runs contradict; typical sizes of errors
that are neither declared nor estimated, which the intervals leave out and the conventional bound holds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Row:
    """An error of a result.

    The ten parameters are mass, r_CG and tensor [kg, m, kg·m²]; of static poses mass, r_CG and offsets [kg, m, N, N·m].
    """

    error: str
    """Name of the error in budgets: of its source, of its key in ``[undeclared]``, or what the runs show."""
    changes: Float[np.ndarray, "10 k"]
    """Changes of the ten by one standard uncertainty of each of the error's independent numbers."""
    tier: Tier = "declared"
    evaluation: Literal["A", "B", "A, B"] = "B"
    """Type of evaluation: A by statistics of the runs, B by other means (GUM 4.2, 4.3)."""
    degrees_of_freedom: Float[np.ndarray, "10"] | float | int = np.inf
    """Degrees of freedom of the standard uncertainties of the ten."""
    key: str = ""
    """Name by which other results know the same error, column by column; '': none shares it."""
    drawn: bool = False
    """Whether each column is one trial: its error about the mean, over the root of the number of trials less one."""
    mean: Float[np.ndarray, "10"] | float = 0.0
    """Expected error of the ten, which is not corrected."""
    text: str = ""
    """Description of an undeclared error in words."""
    figure: str = ""
    """Typical size of an undeclared error, with its unit."""
    signed: bool = False
    """Whether the change is a bias of known sign, which counts as a standard uncertainty."""

    @property
    def standard_uncertainty(self) -> Float[np.ndarray, "10"]:
        """Part of the standard uncertainty of the ten parameters."""
        return np.linalg.norm(self.changes, axis=1)

    @property
    def parameters(self) -> Float[np.ndarray, "10"]:
        """Standard uncertainty of the ten parameters by the error; a signed one's change."""
        return self.changes[:, 0] if self.signed else self.standard_uncertainty

    def changed(self, by: Float[np.ndarray, "10 10"] | Float[np.ndarray, "10 1"]) -> "Row":
        """Return the row of ten other parameters: by their derivatives by these, or by a factor on each (10, 1)."""
        if by.shape == (10, 1):
            return replace(self, changes=by * self.changes, mean=by[:, 0] * self.mean)
        freedom = self.degrees_of_freedom
        if np.ndim(freedom):  # those of what the new parameters are made of, by their part in the variance
            parts = np.square(by * self.standard_uncertainty)
            total = np.maximum(parts.sum(axis=1), 1e-300)
            freedom = 1 / np.maximum((parts / np.asarray(freedom)).sum(axis=1) / total, 1e-12)
        mean = by @ np.broadcast_to(np.asarray(self.mean, float), 10)
        unknown = np.abs(by) @ np.isnan(self.changes) > 0  # and not by a product of NaN with zero
        changes = np.where(unknown, np.nan, by @ np.nan_to_num(self.changes))
        return replace(self, changes=changes, degrees_of_freedom=freedom, mean=mean)


def student_quantile(freedom: np.ndarray | float, probability: np.ndarray | float) -> np.ndarray:
    """Return quantiles of Student's t; of infinite degrees of freedom, of the normal distribution."""
    finite = np.where(np.isfinite(freedom), freedom, 1.0)
    normal = scipy.special.ndtri(probability)
    return np.where(np.isfinite(freedom), scipy.special.stdtrit(finite, probability), normal)


def tensor_row(error: str, changes: Float[np.ndarray, "6 k"], **figures: Any) -> Row:
    """Return the linear row of an error of the tensor alone, by its changes [kg·m²]."""
    return Row(error=error, changes=np.vstack([np.zeros((4, changes.shape[1])), changes]), **figures)


def mass_row(u: float) -> Row:
    """Return the row of a stated mass with this standard uncertainty [kg]."""
    return Row(error="mass", changes=u * np.eye(10)[:, :1])


def drawn_row(error: str, draws: Float[np.ndarray, "trials 6"], **figures: Any) -> Row:
    """Return the row of an error by its draws, of the tensor alone [kg·m²]."""
    mean = draws.mean(axis=0)
    changes = np.vstack([np.zeros((4, len(draws))), (draws - mean).T / np.sqrt(len(draws) - 1)])
    return Row(error=error, changes=changes, drawn=True, mean=np.concatenate([np.zeros(4), mean]), **figures)


def reaching(arms: Float[np.ndarray, "10 2"], u: Float[np.ndarray, "10"]) -> Float[np.ndarray, "10 2"]:
    """Return arms that hold errors whose size is no measurement, too: with k = 2, squares of arms add.

    Args:
        arms: from the value down and up; negative where an expected error takes an end beyond the value.
        u: standard uncertainty by such errors.
    """
    shift = CONVENTIONAL * u[:, None]
    return np.where(arms < 0, arms + shift, np.hypot(arms, shift))


def type_a_rows(pooling: Pooling) -> tuple[Row, ...]:
    """Return residuals, and what runs or mountings scatter beyond what residuals and redrawn sources predict."""
    figures: Any = {
        "tier": "measured", "evaluation": "A",
        "degrees_of_freedom": np.concatenate([np.full(4, np.inf), pooling.effective_degrees_of_freedom]),
    }  # fmt: skip
    between = "scatter between mountings" if pooling.mountings > 1 else "scatter between runs"
    parts = {"residuals": root_of(pooling.from_residuals), between: pooling.beyond_prediction}
    return tuple(tensor_row(error, changes, **figures) for error, changes in parts.items() if changes.any())


class Gap(NamedTuple):
    """The undeclared error with the largest share in the variance of one parameter."""

    row: Row
    parameter: int
    """Index among the ten parameters."""
    share: float
    """Part of the parameter's variance, declared and undeclared errors together."""

    @property
    def text(self) -> str:
        """The gap in words."""
        return (
            f"undeclared: {self.row.text}, at a typical {self.row.figure}, is {100 * self.share:.0f} % of u² of "
            f"{QUANTITIES[self.parameter][0]} with undeclared errors: declare it, or write your figure in [undeclared]"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Ledger(Shown):
    """The errors of a result."""

    rows: tuple[Row, ...] = ()
    expected: Float[np.ndarray, "10"] = field(default_factory=lambda: np.zeros(10))
    """Expected error that is not corrected and may or may not act: intervals hold the true value with and without it
    (GUM F.2.4.5). NaN counts as none."""

    def of_tiers(self, *tiers: Tier) -> "Ledger":
        """Return the rows of some origins."""
        return Ledger(tuple(row for row in self.rows if row.tier in tiers), self.expected)

    @property
    def in_intervals(self) -> "Ledger":
        """The rows that intervals and covariances hold: all but typical sizes."""
        return self.of_tiers("measured", "declared", "contradicted")

    def joined(self, rows: Iterable[Row]) -> "Ledger":
        """Return the ledger with further rows; one of a key takes the place of that key's."""
        added = tuple(rows)
        keys = {row.key for row in added if row.key}
        return Ledger((*(row for row in self.rows if row.key not in keys), *added), self.expected)

    def changed(self, by: Float[np.ndarray, "10 10"] | Float[np.ndarray, "10 1"]) -> "Ledger":
        """Return the ledger of ten other parameters: by their derivatives by these, or by a factor on each (10, 1)."""
        expected = by[:, 0] * self.expected if by.shape == (10, 1) else by @ self.expected
        return Ledger(tuple(row.changed(by) for row in self.rows), expected)

    @property
    def bias(self) -> Float[np.ndarray, "10"]:
        """Expected error of the ten parameters, which is not corrected."""
        return self.expected + sum((np.broadcast_to(row.mean, 10) for row in self.rows), np.zeros(10))

    @property
    def drawn(self) -> Float[np.ndarray, "10 trials"] | None:
        """Errors of the ten by all drawn rows together, as :attr:`Row.changes` has them; None: nothing is drawn."""
        drawn = [row.changes for row in self.rows if row.drawn]
        return np.sum(drawn, axis=0) if drawn else None

    @cached_property
    def covariance(self) -> Float[np.ndarray, "10 10"]:
        """Covariance of the ten parameters."""
        drawn = self.drawn
        parts = [row.changes for row in self.rows if not row.drawn] + ([] if drawn is None else [drawn])
        total = np.zeros((10, 10))
        for changes in parts:
            total += np.nan_to_num(changes) @ np.nan_to_num(changes).T
            total += np.diag(np.where(np.isnan(changes).any(axis=1), np.nan, 0.0))  # not known, and of nothing else
        return total

    @property
    def standard_uncertainty(self) -> Float[np.ndarray, "10"]:
        """Standard uncertainty of the ten parameters."""
        return np.sqrt(np.diag(self.covariance))

    def arms(
        self, probability: float = USUAL, *, physical: Float[np.ndarray, "6 2"] | None = None
    ) -> Float[np.ndarray, "10 2"]:
        """Return the two arms of the coverage interval of each parameter, below and above the value.

        Arms of linear rows add in squares, those of one evaluation by one Student's t. Where others are drawn, the arms
        are quantiles of the sum (JCGM 101, 7.7), to which linear rows add even quantiles in random order, without
        sampling noise. Of errors that the runs contradict no distribution is known: k = 2, and arms add in squares.

        Args:
            probability: coverage probability.
            physical: arms of 95 % of the tensor by linear rows, within physical bodies [kg·m²]; None: by rows alone.
        """
        distributed = self.of_tiers("measured", "declared")
        arms = distributed._with_drawn(distributed._linear(probability, physical), probability, physical is not None)
        mean = sum((np.broadcast_to(row.mean, 10) for row in distributed.rows), np.zeros(10))
        expected = np.nan_to_num(self.expected)
        arms = arms + np.outer(mean, [1, -1]) + np.maximum(np.outer(expected, [1, -1]), 0.0)
        return reaching(arms, self.of_tiers("contradicted").standard_uncertainty)

    def half_width(self, half: Float[np.ndarray, "10"]) -> Float[np.ndarray, "10"]:
        """Return half of the conventional bounds from half of the coverage intervals of 95 %: squares add."""
        return np.hypot(half, CONVENTIONAL * self.of_tiers("typical").standard_uncertainty)

    def bounds(
        self, values: Float[np.ndarray, "10"], intervals: Float[np.ndarray, "10 2"]
    ) -> Float[np.ndarray, "10 2"]:
        """Return the conventional bounds of the ten parameters: each arm of the intervals, widened by typical errors.

        Args:
            values: of the ten parameters.
            intervals: their coverage intervals; infinite or NaN ends stay so.
        """
        arms = (intervals - values[:, None]) * [-1, 1]
        return values[:, None] + reaching(arms, self.of_tiers("typical").standard_uncertainty) * [-1, 1]

    @property
    def _evaluations(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Scales of linear rows' errors and their degrees of freedom; rows of the same ones are one evaluation."""
        squares: dict[bytes, np.ndarray] = {}
        for row in self.rows:
            if not row.drawn:
                key = np.broadcast_to(np.asarray(row.degrees_of_freedom, float), 10).tobytes()
                squares[key] = squares.get(key, np.zeros(10)) + row.standard_uncertainty**2
        return [(np.sqrt(square), np.frombuffer(key)) for key, square in squares.items()]

    def _linear(self, probability: float, physical: np.ndarray | None) -> Float[np.ndarray, "10 2"]:
        half, usual = np.zeros(10), np.zeros(10)
        for scale, freedom in self._evaluations:
            half = np.hypot(half, student_quantile(freedom, (1 + probability) / 2) * scale)
            usual = np.hypot(usual, student_quantile(freedom, (1 + USUAL) / 2) * scale)
        arms = np.stack([half, half], axis=1)
        if physical is not None:  # known at the usual probability alone: others in the proportion of the rows' own
            arms[4:] = physical * np.divide(half, usual, out=np.ones(10), where=usual > 0)[4:, None]
        return arms

    def _with_drawn(self, arms: np.ndarray, probability: float, bounded: bool) -> Float[np.ndarray, "10 2"]:
        """Arms with those of drawn rows: of the sum's distribution, or, within physical bodies, in squares."""
        drawn, upper = self.drawn, (1 + probability) / 2
        if drawn is None:
            return arms
        trials = drawn.shape[1]
        rng, even = np.random.default_rng([SEED, trials]), (np.arange(trials) + 0.5) / trials
        for k in np.flatnonzero(drawn.any(axis=1)):
            errors = drawn[k] * np.sqrt(trials - 1)
            for scale, freedom in [] if bounded else self._evaluations:
                if scale[k] > 0:
                    errors = errors + scale[k] * student_quantile(freedom[k], rng.permutation(even))
            ends = np.quantile(errors, [upper, 1 - upper]) * [1, -1]
            arms[k] = np.hypot(arms[k], ends) if bounded else ends
        return arms

    @property
    def degrees_of_freedom(self) -> Float[np.ndarray, "10"]:
        """Effective degrees of freedom by Welch and Satterthwaite (GUM G.4)."""
        inverse = sum((scale**4 / freedom for scale, freedom in self.in_intervals._evaluations), np.zeros(10))
        with np.errstate(divide="ignore", invalid="ignore"):
            effective = self.in_intervals.standard_uncertainty**4 / inverse
        return np.where(inverse > 0, np.minimum(effective, 1e9), np.inf)

    @property
    def types(self) -> Mapping[str, str]:
        """Type of evaluation of each error of :attr:`budget`: A, B, or both."""
        types: dict[str, set[str]] = {}
        for row in self.in_intervals.rows:
            types.setdefault(row.error, set()).update(row.evaluation.split(", "))
        return {error: ", ".join(sorted(letters)) for error, letters in types.items()}

    @property
    def budget(self) -> Mapping[str, Float[np.ndarray, "10"]]:
        """Contribution of each error to the standard uncertainty of the ten parameters; parts of one error together."""
        squares: dict[str, np.ndarray] = {}
        for row in self.rows:
            if row.tier != "typical":
                squares[row.error] = squares.get(row.error, np.zeros(10)) + row.standard_uncertainty**2
        return {error: np.sqrt(square) for error, square in squares.items()}

    def share(self, u: Float[np.ndarray, "10"]) -> tuple[float, int]:
        """Return the largest standard uncertainty over u, and which of the ten parameters that is.

        Args:
            u: standard uncertainty of the ten by other errors; zero or not finite: the parameter is stated or not
                known, and does not count.
        """
        counted = (u > 0) & np.isfinite(u)
        ratio = np.divide(self.standard_uncertainty, u, out=np.zeros(10), where=counted)
        worst = int(np.argmax(ratio))
        return float(ratio[worst]), worst

    def largest(self, u: Float[np.ndarray, "10"]) -> Gap | None:
        """Return the error with the largest share in the variance of a parameter that is uncertain without it.

        Args:
            u: as for :meth:`share`; None is returned where no error adds to a parameter with u above zero.
        """
        total = np.where(u > 0, u**2 + np.diag(self.covariance), np.inf)
        shares = [row.parameters**2 / total for row in self.rows]
        if not np.any(shares):
            return None
        number, parameter = np.unravel_index(np.argmax(shares), (len(shares), 10))
        return Gap(row=self.rows[number], parameter=int(parameter), share=float(shares[number][parameter]))

    def records(self) -> list[dict[str, Any]]:
        """Return of each row the error, its origin, type and standard uncertainties of the ten parameters, in SI."""
        return [
            {"error": row.error, "tier": row.tier, "type": row.evaluation}
            | dict(zip(PARAMETERS, row.standard_uncertainty.tolist(), strict=True))
            for row in self.rows
        ]

    def to_dict(self) -> list[dict[str, Any]]:
        """Return the content of result.json on undeclared errors, in SI."""
        return [
            {
                "name": row.error,
                "figure": row.figure,
                "signed": row.signed,
                "inertia": by_component(row.parameters[4:]),
                "mass": float(row.parameters[0]),
                "cg": row.parameters[1:4].tolist(),
            }
            for row in self.rows
        ]


def taken_off(
    whole: Ledger, fixture: Ledger, by_whole: Float[np.ndarray, "10 10"], by_fixture: Float[np.ndarray, "10 10"]
) -> Ledger:
    """Return the ledger of a body that is left when its fixture is taken off.

    Args:
        whole: of both together.
        fixture: of the fixture.
        by_whole: derivative of the body's ten parameters by those of both together.
        by_fixture: the same by those of the fixture.
    """
    of_whole, of_fixture = whole.changed(by_whole), fixture.changed(by_fixture)
    keyed = {(row.key, row.changes.shape): row for row in of_fixture.rows if row.key}
    rows = []
    for row in of_whole.rows:
        same = keyed.pop((row.key, row.changes.shape), None)
        rows.append(
            row if same is None else replace(row, changes=row.changes + same.changes, mean=row.mean + same.mean)
        )
    for row in of_fixture.rows:
        if row.key and (row.key, row.changes.shape) not in keyed:
            continue
        if row.drawn:  # of trials of its own
            row = replace(row, changes=root_of(row.changes @ row.changes.T), drawn=False)
        rows.append(row if row.tier == "typical" else replace(row, error=FIXTURE, evaluation="A, B", key=""))
    return Ledger(tuple(rows), of_whole.expected + of_fixture.expected)
