"""Repeated runs scatter more than their residuals predict.

## What it looks like

The tensors of runs of one mounting differ by more than their standard uncertainties let them.

## Why it matters

Something changes from run to run that no single run shows: a clamp, the temperature, a cable. The interval of the mean
counts the scatter; that of a single run would be too narrow.

## How it is decided

The variance between runs over the predicted one is χ² with one degree of freedom less than runs; by Bonferroni over
the six components. An r_CG error common to all runs counts as noise of each, so runs may scatter less than predicted,
which is no finding.

## What to do

Find what differs between the runs: clamp again, let the sensors warm up, lay the cable otherwise. More runs measure
the scatter better.
"""

from identify.judge.findings import Finding
from identify.results.declaration import ResidualCause


class RunsScatter(Finding):
    """Runs that scatter more than predicted, by the words of their comparison."""

    comparison: str
    """Scatter beside its prediction, by component, in words."""

    @property
    def looks(self) -> str:
        return self.comparison

    cure = ""

    def verdict(self, *, axis: str, share: float, adds: str = "") -> ResidualCause:
        """Return it as an entry of a result; ``axis``: the component, ``share``: the scatter over the predicted one."""
        return super().verdict(axis=axis, share=share)._replace(text=self.looks)


EXAMPLES = (
    RunsScatter(
        topic="",
        comparison="the stated noise does not describe this rig's repeatability: I33 (0.0021 against 0.00067) scatters "
        "more than it predicts",
    ),
)
