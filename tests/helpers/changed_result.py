"""An identification with other figures: what a test changes of the ten parameters, their covariance and intervals."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimation.methods.base import Problem
from identify.judge.judged_result import Judged
from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.pooling import NORMAL, student_freedom
from identify.results.identification_result import Identification
from identify.results.ledger import Ledger, Row


def not_judged(result: Identification, problem: Problem) -> Judged:
    """Return what a judge says who looks at nothing: in the place of ``judged``."""
    return Judged(warnings=result.warnings, declarations=result.declarations)


def changed(result: Identification, **figures: Any) -> Identification:
    """Return a result with other values (``mass``, ``r_cg``, ``inertia``), covariances or intervals of its own units.

    Args:
        result: an identification.
        figures: ``covariance`` and ``interval95`` of the tensor, ``covariance_of_ten``, ``intervals95``, ``sigma_r_cg``
            and ``mass_uncertainty`` (uncorrelated), or a value.
    """
    value_alone = figures.keys() <= {"mass", "r_cg", "inertia"}
    ten, intervals = result.parameters, result.intervals95.copy()
    covariance = np.array(figures.pop("covariance_of_ten", ten.covariance))
    if "covariance" in figures:
        covariance[4:, 4:] = figures.pop("covariance")
    if "sigma_r_cg" in figures:
        covariance[1:4] = covariance[:, 1:4] = 0.0
        covariance[1:4, 1:4] = np.diag(np.square(figures.pop("sigma_r_cg")))
    if "mass_uncertainty" in figures:
        covariance[0] = covariance[:, 0] = 0.0
        covariance[0, 0] = (figures.pop("mass_uncertainty") or 0.0) ** 2
    if "interval95" in figures:
        intervals[4:] = figures.pop("interval95")
    intervals = figures.pop("intervals95", intervals)
    value = result.value.copy()
    for name, where in (("mass", 0), ("r_cg", slice(1, 4)), ("inertia", slice(4, 10))):
        value[where] = figures.pop(name, value[where])
    assert not figures
    if value_alone:
        return replace(result, value=value)
    typical = result.ledger.of_tiers("typical").rows
    return replace(result, value=value, ledger=ledger_of(value, covariance, intervals).joined(typical))


def with_typical(result: Identification, rows: Sequence[Row] | None) -> Identification:
    """Return a result with these undeclared errors instead of its own; None: they were not looked at."""
    known = result.ledger.in_intervals
    return replace(result, ledger=known.joined(rows or ()), looked_at_undeclared=rows is not None)


def typical(name: str, changes: np.ndarray, text: str = "", figure: str = "1", signed: bool = False) -> Row:
    """Return an undeclared error."""
    return Row(
        error=name, text=text or name, figure=figure, changes=changes, signed=signed, tier="typical",
        key=f"typical {name}",
    )  # fmt: skip


def ledger_of(value: np.ndarray, covariance: np.ndarray, intervals: np.ndarray) -> Ledger:
    """Return a ledger of ten parameters with this covariance and these intervals."""
    half, u = np.ptp(intervals, axis=1) / 2, np.sqrt(np.diag(covariance))
    factor = np.divide(half, u, out=np.full(10, NORMAL), where=u > 0)
    freedom = student_freedom(np.nan_to_num(factor, nan=NORMAL))
    row = Row(
        error="estimate", changes=root_of(np.nan_to_num(covariance)), degrees_of_freedom=freedom, tier="measured",
        evaluation="A", mean=np.nan_to_num(value - intervals.mean(axis=1)),
    )  # fmt: skip
    return Ledger((row,))
