"""Sizes of errors as messages write them."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from identify.display.rounding import significant, with_uncertainty

ROUNDING = 1e-9
"""Uncertainty over the largest of a cause's coefficients below which a coefficient is left at zero.

Numerical: rounding of doubles in the solution.
"""
WrittenSize = Callable[[Float[np.ndarray, " p"], Float[np.ndarray, " p"]], str]
"""Function that writes the numbers of an error, in SI, with their standard uncertainties."""


def every(scale: float, unit: str) -> WrittenSize:
    """Return the function that writes each number in a unit of ``1 / scale``."""

    def write(values: np.ndarray, spread: np.ndarray) -> str:
        seen = spread > ROUNDING * spread.max()  # the others change nothing of what is compared
        pairs = zip(scale * values[seen], abs(scale) * spread[seen], strict=True)
        numbers = ", ".join(with_uncertainty(value, u) for value, u in pairs)
        return f"{numbers} {unit}" if len(values) == 1 else f"({numbers}) {unit}"

    return write


def largest(scale: float, unit: str) -> WrittenSize:
    """Return the function that writes the largest number in a unit of ``1 / scale``."""
    return lambda values, spread: f"{significant(scale * float(np.abs(values).max()), 2)} {unit}"


def first(scale: float, unit: str) -> WrittenSize:
    """Return the function that writes the first number in a unit of ``1 / scale``."""
    return lambda values, spread: every(scale, unit)(values[:1], spread[:1])
