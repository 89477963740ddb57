"""The experiment's mathematics: from motion to wrench, and from measured wrench and motion back to the inertia tensor.

Pure JAX on arrays in SI units; no files, no randomness, no global settings. Switch on float64 yourself:
``jax.config.update("jax_enable_x64", True)``.
"""

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
from identify.rigid_body.inertia import COMPONENTS, Body, is_admissible, pack, parallel_axis, principal, rotate, unpack
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
