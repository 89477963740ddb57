"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

Public names are imported on first use, so that ``inertia record`` starts without waiting for JAX.
"""

from importlib import import_module
from typing import Any

_WHERE = {
    "bound": "bounds",
    "budget": "source_budget",
    "centre_file": "centre",
    "compare": "expected",
    "datasheet": "datasheets",
    "emulated_tables": "emulated",
    "export": "exports",
    "identify_files": "recorded",
    "import_table": "imports",
    "law": "propagation",
    "load_centre": "centre_prior",
    "load_reference": "reference",
    "load_run": "recorded",
    "montecarlo": "campaign",
    "paper": "barreto2016",
    "propagate": "linear",
    "scatter_verdict": "repeatability",
    "shapley": "sensitivity",
    "simulate": "simulation",
    "sobol": "sensitivity",
    "tare_files": "tare",
    "tared": "tare",
    "with_declared_sources": "systematic",
    "Alignment": "alignment",
    "Bound": "bounds",
    "BudgetResult": "budget_result",
    "Centre": "centre",
    "Comparison": "expected",
    "CurvilinearTrapezoid": "distributions",
    "Design": "design",
    "DesignBound": "design_bound",
    "Empirical": "distributions",
    "EmulatedTables": "emulated",
    "Experiment": "experiment",
    "ExperimentError": "experiment",
    "Exported": "exports",
    "LawResult": "law_result",
    "LinearLaw": "linear",
    "MonteCarloResult": "campaign",
    "MultivariateNormal": "distributions",
    "Normal": "distributions",
    "PaperResult": "barreto2016",
    "Rectangular": "distributions",
    "Report": "certificate",
    "Reference": "reference",
    "ScatterVerdict": "repeatability",
    "SimulatedRun": "simulation",
    "Source": "sources",
    "StudentT": "distributions",
    "Triangular": "distributions",
    "UShaped": "distributions",
}
__all__ = list(_WHERE)


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'uq' has no attribute '{name}'")
    return getattr(import_module(f"uq.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_WHERE])
