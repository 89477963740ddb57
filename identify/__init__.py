"""The experiment's mathematics: from motion to wrench, and from measured wrench and motion back to the inertia tensor.

Arrays in SI units; no files, no randomness, no global settings. Switch on float64 yourself:
``jax.config.update("jax_enable_x64", True)``. The public names are imported on first use; docs/reference/api.md shows
each of them, everything else is imported from its room, such as ``identify.rigid_body.rotation``.

Pure JAX, to be jitted, vmapped and differentiated (tests/identify/test_transformations.py does so):

- ``rigid_body``: inertia, principal_axes, rotation (rotation vectors), dynamics, regressor, pseudo_inertia
  (log_cholesky, pseudo_inertia), solids, fixture (left_over);
- ``motion``: window, trajectory, multisine, attitude, stewart_platform, leg_limits, periodic_motion, stages;
- ``signals``: differentiate (derivative), filters (apply);
- ``estimators``: gram (ordinary_least_squares: from arrays to the tensor), least_squares.

All others take and return NumPy arrays on the host, some around a kernel of these: runs, segments, spectra, pooling,
the joint model, the judge, results and static poses.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # the names stand in __init__.pyi
