"""The experiment's mathematics: from motion to wrench, and from measured wrench and motion back to the inertia tensor.

Pure JAX on arrays in SI units; no files, no randomness, no global settings. Switch on float64 yourself:
``jax.config.update("jax_enable_x64", True)``.
"""

from identify.admissible import Admissible, log_cholesky, pseudo_inertia
from identify.alignment import Aligned
from identify.bounds import Bound, bound
from identify.centre import Attitudes, Centre
from identify.consistency import Verdict, consistency
from identify.estimator import EstimatorSpec
from identify.identification import identify
from identify.identification_result import Identification
from identify.inertia import COMPONENTS, Body, is_admissible, pack, parallel_axis, principal, rotate, unpack
from identify.inertial import Datum, InertialParameters, Principal, Tensor, principal_axes
from identify.pooling import Pooling
from identify.precision import PrecisionWarning
from identify.priors import Alignment
from identify.regressor import omega_r, pi, wrench_regressor
from identify.run import Rest, Run, RunError
from identify.run_estimate import RunEstimate
from identify.tare import Tare, subtract
from identify.trace import Trace
from identify.weak import within_bodies

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
