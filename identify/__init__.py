"""The experiment's mathematics: from motion to wrench, and from measured wrench and motion back to the inertia tensor.

Arrays in SI units; no files, no randomness, no global settings. Switch on float64 yourself:
``jax.config.update("jax_enable_x64", True)``. The public names are imported on first use; docs/reference/api.md shows
each of them, everything else is imported from its room, such as ``identify.rigid_body.rotation``.

Pure JAX, to be jitted, vmapped and differentiated (tests/identify/test_transformations.py does so):

- ``rigid_body``: inertia, principal_axes, rotation (rotation vectors), dynamics, regressor, pseudo_inertia
  (log_cholesky, pseudo_inertia), solids, fixture (left_over);
- ``motion``: window, trajectory, multisine, attitude, stewart_platform, leg_limits, periodic_motion, stages;
- ``signals``: differentiate (derivative), filters (apply), band_limited_run (evaluate);
- ``estimators``: gram (ordinary_least_squares: from arrays to the tensor), least_squares;
- ``joint``: joint_model, gauss_newton.

All others take and return NumPy arrays on the host, some around a kernel of these: runs, segments, spectra, pooling,
diagnostics, the model check, results and static poses.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what editors and type checkers see
    from identify.diagnostics.residual_causes import consistency as consistency
    from identify.estimators.gram import ordinary_least_squares as ordinary_least_squares
    from identify.exceptions import RunError as RunError
    from identify.identification import identify as identify
    from identify.joint.alignment_prior import Alignment as Alignment
    from identify.joint.cramer_rao_bound import bound as bound
    from identify.results.weak_components import within_bodies as within_bodies
    from identify.rigid_body.inertia import Body as Body
    from identify.rigid_body.inertia import pack as pack
    from identify.rigid_body.inertia import parallel_axis as parallel_axis
    from identify.rigid_body.inertia import rotate as rotate
    from identify.rigid_body.inertia import unpack as unpack
    from identify.rigid_body.inertial_parameters import InertialParameters as InertialParameters
    from identify.rigid_body.principal_axes import is_admissible as is_admissible
    from identify.rigid_body.principal_axes import principal as principal
    from identify.rigid_body.pseudo_inertia import log_cholesky as log_cholesky
    from identify.rigid_body.pseudo_inertia import pseudo_inertia as pseudo_inertia
    from identify.rigid_body.regressor import omega_r as omega_r
    from identify.rigid_body.regressor import pi as pi
    from identify.rigid_body.regressor import wrench_regressor as wrench_regressor
    from identify.signals.estimator_spec import EstimatorSpec as EstimatorSpec
    from identify.signals.run import Run as Run
    from identify.static.centre_result import Centre as Centre

_ROOMS = {
    "Alignment": "identify.joint.alignment_prior",
    "Body": "identify.rigid_body.inertia",
    "Centre": "identify.static.centre_result",
    "EstimatorSpec": "identify.signals.estimator_spec",
    "InertialParameters": "identify.rigid_body.inertial_parameters",
    "Run": "identify.signals.run",
    "RunError": "identify.exceptions",
    "bound": "identify.joint.cramer_rao_bound",
    "consistency": "identify.diagnostics.residual_causes",
    "identify": "identify.identification",
    "is_admissible": "identify.rigid_body.principal_axes",
    "log_cholesky": "identify.rigid_body.pseudo_inertia",
    "omega_r": "identify.rigid_body.regressor",
    "ordinary_least_squares": "identify.estimators.gram",
    "pack": "identify.rigid_body.inertia",
    "parallel_axis": "identify.rigid_body.inertia",
    "pi": "identify.rigid_body.regressor",
    "principal": "identify.rigid_body.principal_axes",
    "pseudo_inertia": "identify.rigid_body.pseudo_inertia",
    "rotate": "identify.rigid_body.inertia",
    "unpack": "identify.rigid_body.inertia",
    "within_bodies": "identify.results.weak_components",
    "wrench_regressor": "identify.rigid_body.regressor",
}
__all__ = list(_ROOMS)

if not TYPE_CHECKING:  # hidden from them: a name that is not public is an error, not Any

    def __getattr__(name: str) -> object:
        if name not in _ROOMS:
            raise AttributeError(f"module 'identify' has no attribute '{name}'")
        return getattr(import_module(_ROOMS[name]), name)

    def __dir__() -> list[str]:
        return sorted(_ROOMS)
