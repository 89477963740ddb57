"""Estimators, one file each: from runs and priors to the tensor.

The name of the file is the method's in ``identify(..., method=)``, ``recording.method`` and ``--method``.
"""

from pkgutil import iter_modules

SHARED = ("base",)
"""Modules here that are no estimator."""


def names() -> tuple[str, ...]:
    """Return the names of all estimators, without importing them."""
    return tuple(sorted(module.name for module in iter_modules(__path__) if module.name not in SHARED))
