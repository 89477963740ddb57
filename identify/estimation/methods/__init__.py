"""Estimators, one file each: from runs and priors to the tensor.

The name of an entry point of the group ``inertia_uq.methods`` is the method's in ``identify(..., method=)``,
``recording.method`` and ``--method``.
"""

from importlib.metadata import entry_points

ENTRIES = entry_points(group="inertia_uq.methods")


def names() -> tuple[str, ...]:
    """Return the names of all estimators, without importing them."""
    return tuple(sorted(ENTRIES.names))
