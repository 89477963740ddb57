"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

Public names are imported on first use, so that ``inertia record`` starts without waiting for JAX.
"""

from importlib import import_module
from typing import Any

_WHERE = {
    "achieved": "achieved_motion",
    "bound": "bounds",
    "budget": "source_budget",
    "centre_file": "centre",
    "compare": "expected",
    "datasheet": "datasheets",
    "design": "designing",
    "design_report": "design_result",
    "emulated_tables": "emulated",
    "export": "exports",
    "export_motion": "motion_export",
    "identify_files": "recorded",
    "import_table": "imports",
    "law": "propagation",
    "load_centre": "centre_prior",
    "load_reference": "reference",
    "load_run": "recorded",
    "montecarlo": "campaign",
    "paper": "barreto2016",
    "plan_poses": "pose_plan",
    "propagate": "linear",
    "required_duration": "lasting",
    "scatter_verdict": "repeatability",
    "sensor_worth": "sensors",
    "shapley": "sensitivity",
    "simulate": "simulation",
    "sobol": "sensitivity",
    "tare_files": "tare",
    "tared": "tare",
    "with_declared_sources": "systematic",
    "Achieved": "achieved_motion",
    "Alignment": "alignment",
    "Bound": "bounds",
    "BudgetResult": "budget_result",
    "Centre": "centre",
    "Comparison": "expected",
    "CurvilinearTrapezoid": "distributions",
    "Design": "designing",
    "DesignBound": "design_bound",
    "DesignReport": "design_result",
    "Duration": "lasting",
    "Empirical": "distributions",
    "EmulatedTables": "emulated",
    "Experiment": "experiment",
    "ExperimentError": "experiment",
    "Exported": "exports",
    "LawResult": "law_result",
    "LinearLaw": "linear",
    "MonteCarloResult": "campaign",
    "MotionExport": "motion_export",
    "MultivariateNormal": "distributions",
    "Normal": "distributions",
    "PaperResult": "barreto2016",
    "PosePlan": "pose_plan",
    "Rectangular": "distributions",
    "Reference": "reference",
    "Report": "certificate",
    "ScatterVerdict": "repeatability",
    "SensorWorth": "sensors",
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
