"""The experiment's mathematics: from motion to wrench, and from measured wrench and motion back to the inertia tensor.

Pure JAX on arrays in SI units; no files, no randomness, no global settings. Switch on float64 yourself:
``jax.config.update("jax_enable_x64", True)``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identify.diagnostics.consistency import Verdict, consistency
    from identify.estimators.admissible import Admissible, log_cholesky, pseudo_inertia
    from identify.estimators.repeatability import Pooling
    from identify.estimators.residual_trace import Trace
    from identify.identification import identify
    from identify.joint.cramer_rao_bound import Bound, bound
    from identify.joint.priors import Alignment
    from identify.precision import PrecisionWarning
    from identify.results.alignment import Aligned
    from identify.results.identification_result import Identification
    from identify.results.run_estimate import RunEstimate
    from identify.results.weak_components import within_bodies
    from identify.rigid_body.fixture import Tare, subtract
    from identify.rigid_body.inertia import (
        COMPONENTS,
        Body,
        is_admissible,
        pack,
        parallel_axis,
        principal,
        rotate,
        unpack,
    )
    from identify.rigid_body.inertial_parameters import Datum, InertialParameters, Principal, Tensor, principal_axes
    from identify.rigid_body.regressor import omega_r, pi, wrench_regressor
    from identify.signals.estimator_spec import EstimatorSpec
    from identify.signals.run import Rest, Run, RunError
    from identify.static.centre import Attitudes, Centre

__all__ = [
    "COMPONENTS",
    "Admissible",
    "Aligned",
    "Alignment",
    "Attitudes",
    "Body",
    "Bound",
    "Centre",
    "Datum",
    "EstimatorSpec",
    "Identification",
    "InertialParameters",
    "Pooling",
    "PrecisionWarning",
    "Principal",
    "Rest",
    "Run",
    "RunError",
    "RunEstimate",
    "Tare",
    "Tensor",
    "Trace",
    "Verdict",
    "bound",
    "consistency",
    "identify",
    "is_admissible",
    "log_cholesky",
    "omega_r",
    "pack",
    "parallel_axis",
    "pi",
    "principal",
    "principal_axes",
    "pseudo_inertia",
    "rotate",
    "subtract",
    "unpack",
    "within_bodies",
    "wrench_regressor",
]

_NAMES = {
    "identify.diagnostics.consistency": ("Verdict", "consistency"),
    "identify.estimators.admissible": ("Admissible", "log_cholesky", "pseudo_inertia"),
    "identify.estimators.repeatability": ("Pooling",),
    "identify.estimators.residual_trace": ("Trace",),
    "identify.identification": ("identify",),
    "identify.joint.cramer_rao_bound": ("Bound", "bound"),
    "identify.joint.priors": ("Alignment",),
    "identify.precision": ("PrecisionWarning",),
    "identify.results.alignment": ("Aligned",),
    "identify.results.identification_result": ("Identification",),
    "identify.results.run_estimate": ("RunEstimate",),
    "identify.results.weak_components": ("within_bodies",),
    "identify.rigid_body.fixture": ("Tare", "subtract"),
    "identify.rigid_body.inertia": (
        "COMPONENTS",
        "Body",
        "is_admissible",
        "pack",
        "parallel_axis",
        "principal",
        "rotate",
        "unpack",
    ),
    "identify.rigid_body.inertial_parameters": ("Datum", "InertialParameters", "Principal", "Tensor", "principal_axes"),
    "identify.rigid_body.regressor": ("omega_r", "pi", "wrench_regressor"),
    "identify.signals.estimator_spec": ("EstimatorSpec",),
    "identify.signals.run": ("Rest", "Run", "RunError"),
    "identify.static.centre": ("Attitudes", "Centre"),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a public name on first use: who needs one module must not wait for all, nor for JAX."""
    if name not in _MODULES:
        raise AttributeError(f"module 'identify' has no attribute '{name}'")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
