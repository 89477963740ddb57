"""Physical values with their units, converted once at the edge: ``"0.38 N*m"`` to a float in SI.

An angle is a dimension of its own here, so ``"5 Hz"`` is not taken for 5 rad/s, nor ``"1/s"`` for rad/s.
"""

import math
import tokenize
from functools import cache

import pint


class UnitError(ValueError):
    """A value that is not a number with a unit of the asked dimension."""


@cache
def _registry() -> pint.UnitRegistry:
    registry = pint.UnitRegistry(on_redefinition="ignore", cache_folder=None)
    registry.define("radian = [angle] = rad")
    return registry


def quantity(text: object, unit: str) -> float:
    """Return a value written with its unit, in ``unit``.

    Args:
        text: a number and a unit, such as ``"4.3e-4 rad/s"``.
        unit: the unit of the result, which gives the dimension that is asked.

    Raises:
        UnitError: ``text`` is a bare number, not a number with a unit, not finite, or of another dimension.
    """
    if not isinstance(text, str):
        raise UnitError(f"is {text!r}: write a value with its unit, such as \"1 {unit}\"")
    try:
        value = _registry().Quantity(text)
        converted = value.to(unit)
    except pint.DimensionalityError:
        raise UnitError(f"is {text!r}: write a unit of the same dimension as {unit}") from None
    except (pint.PintError, tokenize.TokenError, ArithmeticError, TypeError, ValueError, AttributeError, SyntaxError):
        raise UnitError(f"is {text!r}: write a number and a unit, such as \"1 {unit}\"") from None
    magnitude = converted.magnitude
    if not isinstance(magnitude, (int, float)) or not math.isfinite(magnitude):
        raise UnitError(f"is {text!r}: write a finite number and a unit")
    return float(magnitude)
