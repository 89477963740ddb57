"""Measurement uncertainty of an identified inertia tensor: error sources, Monte Carlo, breakdown, reports, commands.

The public names are imported on first use, so that ``inertia record`` starts without waiting for JAX. Each is in
docs/reference/api.md; everything else is imported from its room, such as ``uq.sources.distributions``.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what editors and type checkers see
    from uq.barreto2016 import paper as paper
    from uq.bodies.comparison import compare as compare
    from uq.bodies.export import export as export
    from uq.bodies.reference import load_reference as load_reference
    from uq.campaign.campaign import montecarlo as montecarlo
    from uq.campaign.simulation import simulate as simulate
    from uq.excitation.design import design as design
    from uq.excitation.design_report import design_report as design_report
    from uq.experiment.experiment import Experiment as Experiment
    from uq.files.document import ExperimentError as ExperimentError
    from uq.identification.identify_files import identify_files as identify_files
    from uq.identification.static_centre import centre_file as centre_file
    from uq.identification.tare import tare_files as tare_files
    from uq.planning.explore import explore as explore
    from uq.planning.motion_export import export_motion as export_motion
    from uq.planning.pose_plan import plan_poses as plan_poses
    from uq.planning.required_duration import required_duration as required_duration
    from uq.planning.sensor_worth import sensor_worth as sensor_worth
    from uq.propagation.experiment_law import law as law
    from uq.propagation.law_of_propagation import propagate as propagate
    from uq.recorded.load_run import load_run as load_run
    from uq.sensitivity.sobol_shapley import shapley as shapley
    from uq.sensitivity.sobol_shapley import sobol as sobol
    from uq.sensitivity.source_budget import budget as budget
    from uq.tracking.achieved_motion import achieved as achieved

_ROOMS = {
    "Experiment": "uq.experiment.experiment",
    "ExperimentError": "uq.files.document",
    "achieved": "uq.tracking.achieved_motion",
    "budget": "uq.sensitivity.source_budget",
    "centre_file": "uq.identification.static_centre",
    "compare": "uq.bodies.comparison",
    "design": "uq.excitation.design",
    "design_report": "uq.excitation.design_report",
    "explore": "uq.planning.explore",
    "export": "uq.bodies.export",
    "export_motion": "uq.planning.motion_export",
    "identify_files": "uq.identification.identify_files",
    "law": "uq.propagation.experiment_law",
    "load_reference": "uq.bodies.reference",
    "load_run": "uq.recorded.load_run",
    "montecarlo": "uq.campaign.campaign",
    "paper": "uq.barreto2016",
    "plan_poses": "uq.planning.pose_plan",
    "propagate": "uq.propagation.law_of_propagation",
    "required_duration": "uq.planning.required_duration",
    "sensor_worth": "uq.planning.sensor_worth",
    "shapley": "uq.sensitivity.sobol_shapley",
    "simulate": "uq.campaign.simulation",
    "sobol": "uq.sensitivity.sobol_shapley",
    "tare_files": "uq.identification.tare",
}
__all__ = list(_ROOMS)

if not TYPE_CHECKING:  # hidden from them: a name that is not public is an error, not Any

    def __getattr__(name: str) -> object:
        if name not in _ROOMS:
            raise AttributeError(f"module 'uq' has no attribute '{name}'")
        return getattr(import_module(_ROOMS[name]), name)

    def __dir__() -> list[str]:
        return sorted(_ROOMS)
