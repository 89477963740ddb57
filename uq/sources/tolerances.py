"""Quantities with their uncertainty as a drawing or a calibration certificate states it.

Either a string with its unit, which is exact, or a table with ``value`` and one of ``tolerance`` (half-width, or lower
and upper deviation), ``standard_uncertainty``, ``expanded_uncertainty``.
"""

import math
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal

import msgspec

from rig.exceptions import quoted
from rig.toml_tables import TomlTable, WrongKeyError, read_table, read_value, written
from uq.files.schema import in_unit, quantity_schema
from uq.sources.distributions import BETWEEN_LIMITS, Distribution, Normal

STATED = ("tolerance", "standard_uncertainty", "expanded_uncertainty")

UncertainQuantity = float | Distribution
"""A number where the quantity is exact, else its distribution."""


def uncertain(unit: str, *, above: float | int = -math.inf) -> msgspec.Meta:
    """Return the annotation of a quantity in ``unit``: a number where it is exact, else its distribution.

    Args:
        unit: unit of the value.
        above: what all its values must exceed.
    """

    def read(path: str, raw: Any) -> UncertainQuantity:
        if not isinstance(raw, Mapping):
            return float(read_value(path, raw, Annotated[float, in_unit(unit, above=above)]))
        distribution = read_table(path, raw, _table(unit, above)).distribution_of_value
        if getattr(distribution, "low", math.inf) <= above:
            raise ValueError(f"has a tolerance {quoted(raw['tolerance'])}: the limits must be above zero")
        return distribution

    return written(read, _schema(unit))


def uncertain_vector(unit: str, *, above: float | int = -math.inf) -> msgspec.Meta:
    """Return the annotation of three quantities in ``unit``, one per axis, each as of :func:`uncertain`."""
    component = Annotated[UncertainQuantity, uncertain(unit, above=above)]

    def read(path: str, raw: Any) -> tuple[UncertainQuantity, ...]:
        return read_value(path, raw, tuple[component, component, component])

    return written(read, {"type": "array", "items": _schema(unit), "minItems": 3, "maxItems": 3})


def mean(quantity: UncertainQuantity) -> float:
    """Return a quantity's best estimate."""
    return float(quantity.mean) if isinstance(quantity, Distribution) else float(quantity)


@cache
def _table(unit: str, above: float | int) -> Any:
    """The table of a quantity in a unit."""

    class Uncertain(TomlTable, frozen=True, kw_only=True):
        value: Annotated[float, in_unit(unit, above=above)]
        tolerance: Annotated[float | tuple[float, float], written(_tolerance(unit), {})] | None = None
        standard_uncertainty: Annotated[float, in_unit(unit, above=0)] | None = None
        expanded_uncertainty: Annotated[float, in_unit(unit, above=0)] | None = None
        coverage_factor: float | None = None
        distribution: Literal["rectangular", "triangular", "u_shaped"] | None = None

        def __post_init__(self) -> None:
            stated = [key for key in STATED if getattr(self, key) is not None]
            if len(stated) != 1:
                raise WrongKeyError("", f"has {len(stated)} of {', '.join(STATED)}: give one")
            needed = {"coverage_factor": "expanded_uncertainty", "distribution": "tolerance"}
            for key, owner in needed.items():
                if getattr(self, key) is not None and stated != [owner]:
                    raise WrongKeyError(key, "remove it", f"belongs to {owner}")
            if self.coverage_factor is not None and self.coverage_factor <= 0:
                raise WrongKeyError("coverage_factor", "write a number above zero")

        @property
        def distribution_of_value(self) -> Distribution:
            """Distribution between the limits of a tolerance; else normal, from an expanded uncertainty over k."""
            if self.tolerance is not None:
                shape = BETWEEN_LIMITS[self.distribution or "rectangular"]
                low, high = self.tolerance if isinstance(self.tolerance, tuple) else (-self.tolerance, self.tolerance)
                return shape(self.value + low, self.value + high)
            if self.standard_uncertainty is not None:
                return Normal(self.value, self.standard_uncertainty)
            factor = 2.0 if self.coverage_factor is None else self.coverage_factor
            return Normal(self.value, (self.expanded_uncertainty or 0.0) / factor)

    return Uncertain


def _tolerance(unit: str) -> Any:
    """Return the function that reads the half-width of a tolerance, or its two deviations."""
    deviation = Annotated[float, in_unit(unit)]

    def read(path: str, raw: Any) -> float | tuple[float, float]:
        if not isinstance(raw, list):
            return read_value(path, raw, Annotated[float, in_unit(unit, above=0)])
        ends = read_value(path, raw, tuple[deviation, ...])
        if len(ends) != 2 or not ends[0] < ends[1]:
            raise ValueError(f"is {quoted(raw)}: write the lower deviation, then the upper")
        return ends[0], ends[1]

    return read


def _schema(unit: str) -> dict[str, Any]:
    size = quantity_schema(unit)
    deviations = {"type": "array", "items": size, "minItems": 2, "maxItems": 2}
    keys = {
        "value": size,
        "tolerance": {"anyOf": [size, deviations]},
        "standard_uncertainty": size,
        "expanded_uncertainty": size,
        "coverage_factor": {"type": "number", "exclusiveMinimum": 0},
        "distribution": {"enum": list(BETWEEN_LIMITS)},
    }
    table = {"type": "object", "properties": keys, "required": ["value"], "additionalProperties": False}
    forms = [size, {**table, "oneOf": [{"required": [key]} for key in STATED]}]
    return {"title": f"uncertain quantity in {unit}", "anyOf": forms}
