"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

Public names are imported on first use, so that ``inertia record`` starts without waiting for JAX.
"""

from importlib import import_module
from typing import Any

_WHERE = {
    "bound": "bounds",
    "budget": "source_budget",
    "centre_file": "centre",
    "datasheet": "datasheets",
    "identify_files": "recorded",
    "import_table": "imports",
    "law": "propagation",
    "load_run": "recorded",
    "montecarlo": "campaign",
    "paper": "barreto2016",
    "propagate": "linear",
    "shapley": "sensitivity",
    "simulate": "simulation",
    "sobol": "sensitivity",
    "Alignment": "alignment",
    "Bound": "bounds",
    "BudgetResult": "budget_result",
    "Centre": "centre",
    "CurvilinearTrapezoid": "distributions",
    "Empirical": "distributions",
    "Experiment": "experiment",
    "ExperimentError": "experiment",
    "LawResult": "law_result",
    "LinearLaw": "linear",
    "MonteCarloResult": "campaign",
    "MultivariateNormal": "distributions",
    "Normal": "distributions",
    "PaperResult": "barreto2016",
    "Rectangular": "distributions",
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
