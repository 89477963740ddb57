"""Quantities with their uncertainty as a drawing or a calibration certificate states it.

Either a string with its unit, which is exact, or a table with ``value`` and one of ``tolerance`` (half-width, or lower
and upper deviation), ``standard_uncertainty``, ``expanded_uncertainty``.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from uq.files.document import REQUIRED, ExperimentError, Table
from uq.sources.distributions import Distribution, Normal, Rectangular, Triangular, UShaped

WITHIN: Mapping[str, Any] = {"rectangular": Rectangular, "triangular": Triangular, "u_shaped": UShaped}
"""Distributions between two limits."""
STATED = ("tolerance", "standard_uncertainty", "expanded_uncertainty")

Known = float | Distribution


def uncertain(table: Table, key: str, unit: str, default: Any = REQUIRED, *, positive: bool = False) -> Known | Any:
    """Return a quantity in ``unit``: a number where it is exact, else its distribution.

    Args:
        table: where it stands.
        key: under which key.
        unit: unit of the result.
        default: what a missing key means.
        positive: whether all its values must be above zero.

    Raises:
        ExperimentError: it is not written as this module says.
    """
    raw = table.raw(key, default)
    if key not in table.content:
        return default
    return _known(Table(table.path(key), raw) if isinstance(raw, Mapping) else table, key, raw, unit, positive)


def uncertain_vector(table: Table, key: str, unit: str, default: Any = REQUIRED) -> tuple[Known, ...]:
    """Return three quantities in ``unit``, each as of :func:`uncertain`."""
    raw = table.raw(key, default)
    if not isinstance(raw, list) or len(raw) != 3:
        raise ExperimentError(f"{table.path(key)} is {raw!r}: write three values with their units, one an axis")
    each = Table(table.where, {f"{key}[{k}]": item for k, item in enumerate(raw)})
    return tuple(uncertain(each, f"{key}[{k}]", unit) for k in range(3))


def _known(table: Table, key: str, raw: Any, unit: str, positive: bool) -> Known:
    if not isinstance(raw, Mapping):
        return float(table.quantity(key, unit, positive=positive))
    value = table.quantity("value", unit, positive=positive)
    stated = [name for name in STATED if name in raw]
    if len(stated) != 1:
        raise ExperimentError(f"{table.where} has {len(stated)} of {', '.join(STATED)}: give one")
    found = _between(table, value, unit) if stated == ["tolerance"] else _normal(table, stated[0], value, unit)
    table.finish()
    if positive and getattr(found, "low", value) <= 0:
        raise ExperimentError(f"{table.path('tolerance')} is {raw['tolerance']!r}: the limits must be above zero")
    return found


def _between(table: Table, value: float, unit: str) -> Distribution:
    """Between the limits of a tolerance."""
    kind = WITHIN[table.choice("distribution", tuple(WITHIN), "rectangular")]
    raw = table.raw("tolerance")
    if not isinstance(raw, list):
        half = table.quantity("tolerance", unit, positive=True)
        return kind(value - half, value + half)
    each = Table(table.where, {f"tolerance[{k}]": item for k, item in enumerate(raw)})
    ends = [each.quantity(name, unit) for name in each.content]
    if len(ends) != 2 or not ends[0] < ends[1]:
        raise ExperimentError(f"{table.path('tolerance')} is {raw!r}: write the lower deviation, then the upper")
    return kind(value + ends[0], value + ends[1])


def _normal(table: Table, stated: str, value: float, unit: str) -> Distribution:
    """Normal with a standard uncertainty, or an expanded one over its coverage factor (2 unless stated)."""
    factor = 1.0
    if stated == "expanded_uncertainty":
        factor = float(table.numbers("coverage_factor", (), np.array(2.0)))
        if factor <= 0:
            raise ExperimentError(f"{table.path('coverage_factor')} is {factor:g}: write a number above zero")
    return Normal(value, table.quantity(stated, unit, positive=True) / factor)
