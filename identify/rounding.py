"""How numbers are printed: to the digits that their uncertainty has (GUM 7.2.6), and never with an exponent.

Terminal, notebook, page and figure print numbers by these functions; JSON and DataFrames hold all digits. A value comes
as "374.9 ± 4.9", or in concise notation as "374.9(4.9)"; below one the parentheses hold the last digits: "5.020(11)".
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_CONCISE = ContextVar("concise", default=False)


@contextmanager
def concise() -> Iterator[None]:
    """Put uncertainties in parentheses while this context lasts: the concise notation."""
    before = _CONCISE.set(True)
    try:
        yield
    finally:
        _CONCISE.reset(before)


def decimals(uncertainty: float, digits: int = 2) -> int:
    """Return the decimals that show so many digits of an uncertainty (GUM 7.2.6); below zero: tens, hundreds."""
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 6
    exponent = int(f"{uncertainty:.{digits - 1}e}".partition("e")[2])  # of the rounded value: 9.97 is 10
    return digits - 1 - exponent


def fixed(value: float, places: int) -> str:
    """Return a figure with these decimals and a minus sign, but never a minus before nought; – for none."""
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if math.isnan(value):
        return "–"
    return f"{round(value, places) + 0.0:.{max(places, 0)}f}".replace("-", "−")


def rounded(value: float, uncertainty: float, digits: int = 2) -> str:
    """Return a figure to so many digits of its uncertainty; to four of its own where that is nought or not known."""
    if math.isfinite(value) and not (math.isfinite(uncertainty) and uncertainty > 0):
        return significant(value, 4)
    return fixed(value, decimals(uncertainty, digits))


def with_uncertainty(value: float, uncertainty: float, places: int | None = None) -> str:
    """Return a figure with its standard uncertainty or standard error, ``−30.644 ± 0.054``: two digits of it.

    Where it is nought or not known, the figure stands alone, with four digits.

    Args:
        value: the figure.
        uncertainty: of it, in the same unit.
        places: most decimals; what is uncertain by less than half of the last of them stands alone.
    """
    if not (math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0):
        return rounded(value, 0.0) if places is None else _at_most(value, places)
    shown = decimals(uncertainty) if places is None else min(decimals(uncertainty), places)
    after = fixed(uncertainty, shown)
    if not float(after):
        return fixed(value, shown)
    return f"{fixed(value, shown)} ± {after}" if not _CONCISE.get() else fixed(value, shown) + _in_parentheses(after)


def finest(uncertainties: Iterable[float]) -> int:
    """Return the most decimals of a table: two more than the least uncertainty of its totals asks for."""
    return 2 + max((decimals(u) for u in uncertainties if math.isfinite(u) and u > 0), default=2)


def beside_uncertainty(value: float, uncertainty: float, places: int | None = None) -> str:
    """Return a value that has its uncertainty in another column: without it, but for the concise notation.

    Args:
        value: the figure.
        uncertainty: its standard uncertainty, in the same unit.
        places: decimals, where not the uncertainty's own.
    """
    shown = decimals(uncertainty) if places is None else places
    known = math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0
    if not known and places is None:
        return rounded(value, uncertainty)
    after = _in_parentheses(fixed(uncertainty, shown)) if known and _CONCISE.get() else ""
    return fixed(value, shown) + after


def significant(value: float, digits: int = 3) -> str:
    """Return a figure with so many digits, its last noughts kept: 4.80 and 11.0 beside 5.02."""
    return fixed(value, decimals(abs(value), digits)) if value else "0"


def common(values: Iterable[float], digits: int = 3) -> list[str]:
    """Return figures of one quantity with the same decimals: so many digits of the largest, but no less than units."""
    figures = [float(value) for value in values]
    largest = max((abs(value) for value in figures if math.isfinite(value)), default=0.0)
    return [fixed(value, max(decimals(largest, digits), 0) if largest else 0) for value in figures]


def exact(values: Iterable[float]) -> list[str]:
    """Return figures that count as exact: all digits that are stated, six at most, with the same decimals."""
    figures = [float(value) for value in values]
    most = decimals(max(map(abs, figures), default=0.0), 9)  # what is smaller comes from the arithmetic
    written = [fixed(value, max(min(decimals(abs(value), 6), most), 0) if value else 0) for value in figures]
    needed = max((len(text.partition(".")[2].rstrip("0")) for text in written), default=0)
    return [fixed(value, needed) for value in figures]


def _at_most(value: float, places: int) -> str:
    return fixed(value, min(decimals(abs(value), 4), places)) if value else "0"


def _in_parentheses(uncertainty: str) -> str:
    """The digits of an uncertainty below one, else all of it: (11) and (4.9)."""
    return f"({uncertainty if float(uncertainty) >= 1 else uncertainty.replace('.', '').lstrip('0')})"
