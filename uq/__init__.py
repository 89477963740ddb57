"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

Public names are imported on first use, so that ``inertia record`` starts without waiting for JAX.
"""

from importlib import import_module
from typing import Any

_WHERE = {
    "achieved": "uq.planning.achieved_motion",
    "bound": "uq.planning.cramer_rao_bound",
    "budget": "uq.sensitivity.source_budget",
    "centre_file": "uq.identification.static_centre",
    "compare": "uq.bodies.normalised_error",
    "datasheet": "uq.sources.datasheet",
    "design": "uq.excitation.design",
    "design_report": "uq.excitation.design_report",
    "emulated_tables": "uq.campaign.emulated_tables",
    "export": "uq.bodies.export",
    "export_motion": "uq.planning.motion_export",
    "identify_files": "uq.identification.identify_files",
    "import_table": "uq.recorded.import_table",
    "law": "uq.propagation.experiment_law",
    "load_centre": "uq.identification.centre_prior",
    "load_reference": "uq.bodies.reference",
    "load_run": "uq.recorded.load_run",
    "montecarlo": "uq.campaign.campaign",
    "paper": "uq.barreto2016",
    "plan_poses": "uq.planning.pose_plan",
    "propagate": "uq.propagation.law_of_propagation",
    "required_duration": "uq.planning.required_duration",
    "scatter_verdict": "uq.identification.run_scatter",
    "sensor_worth": "uq.planning.sensor_worth",
    "shapley": "uq.sensitivity.sobol_shapley",
    "simulate": "uq.campaign.simulation",
    "sobol": "uq.sensitivity.sobol_shapley",
    "tare_files": "uq.identification.tare",
    "tared": "uq.identification.tare",
    "with_declared_sources": "uq.identification.systematic",
    "Achieved": "uq.planning.achieved_motion",
    "Alignment": "uq.experiment.alignment_prior",
    "Bound": "uq.planning.cramer_rao_bound",
    "BudgetResult": "uq.sensitivity.budget_result",
    "Centre": "uq.identification.static_centre",
    "Comparison": "uq.bodies.normalised_error",
    "CurvilinearTrapezoid": "uq.sources.distributions",
    "Design": "uq.excitation.design",
    "DesignBound": "uq.excitation.design_bound",
    "DesignReport": "uq.excitation.design_report",
    "Duration": "uq.planning.required_duration",
    "Empirical": "uq.sources.distributions",
    "EmulatedTables": "uq.campaign.emulated_tables",
    "Experiment": "uq.experiment.experiment",
    "ExperimentError": "uq.experiment.experiment",
    "Exported": "uq.bodies.export",
    "LawResult": "uq.propagation.law_result",
    "LinearLaw": "uq.propagation.law_of_propagation",
    "MonteCarloResult": "uq.campaign.campaign",
    "MotionExport": "uq.planning.motion_export",
    "MultivariateNormal": "uq.sources.distributions",
    "Normal": "uq.sources.distributions",
    "PaperResult": "uq.barreto2016",
    "PosePlan": "uq.planning.pose_plan",
    "Rectangular": "uq.sources.distributions",
    "Reference": "uq.bodies.reference",
    "Report": "uq.experiment.report_table",
    "ScatterVerdict": "uq.identification.run_scatter",
    "SensorWorth": "uq.planning.sensor_worth",
    "SimulatedRun": "uq.campaign.simulation",
    "Source": "uq.sources.source",
    "StudentT": "uq.sources.distributions",
    "Triangular": "uq.sources.distributions",
    "UShaped": "uq.sources.distributions",
}
__all__ = list(_WHERE)


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'uq' has no attribute '{name}'")
    return getattr(import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_WHERE])
