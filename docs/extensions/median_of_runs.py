"""The median of the runs' own estimates: robust against a spoiled run."""

from dataclasses import replace

import numpy as np

from identify.estimation.methods.base import Method, Problem, estimator_of
from identify.exceptions import RunError
from identify.results.identification_result import Identification

EFFICIENCY = np.pi / 2
"""Variance of the median over that of the mean, of many normal values."""


class MedianOfRuns(Method):
    """Component by component; every run by the paper's least squares."""

    type_a = "The value is the median of the runs' estimates; its uncertainty follows from their mean's."

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty."""
        if len(problem.runs) < 3:
            raise RunError(f"{len(problem.runs)} runs have no median: give three or more, or use the method source")
        source = estimator_of("source")
        each = np.array([source.fit(replace(problem, runs=(run,))).inertia for run in problem.runs])
        pooled, median = source.fit(problem), np.median(each, axis=0)
        wider = np.sqrt(np.repeat([1.0, EFFICIENCY], [4, 6]))[:, None]  # the tensor, not mass and centre of gravity
        value = np.concatenate([pooled.value[:4], median])
        return replace(pooled, value=value, ledger=pooled.ledger.changed(wider), pooling=None, method="median_of_runs")
