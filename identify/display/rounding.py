"""Rounding of printed numbers to the digits that their uncertainty has (GUM 7.2.6).

Terminal, notebook, page and figure print numbers by these functions; JSON and DataFrames hold all digits. A value comes
as "374.9 ± 4.9", or in concise notation as "374.9(4.9)"; below one the parentheses hold the last digits: "5.020(11)".
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import SupportsFloat

_CONCISE = ContextVar("concise", default=False)
ROUNDING = 1e-9
"""Part of a value below which its uncertainty is the arithmetic's, and it counts as exact: no instrument has less."""
DUST = 1e-12
"""Size, in the printed unit, below which a value is a rounding error and printed as 0."""
MOST_DECIMALS = 8
"""Decimals from which a figure below 1e-6 is written with a power of ten, ``1.4e−9``; so is one of 1e15 or more."""
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@contextmanager
def concise() -> Iterator[None]:
    """Put uncertainties in parentheses while this context lasts: the concise notation."""
    before = _CONCISE.set(True)
    try:
        yield
    finally:
        _CONCISE.reset(before)


def decimals(uncertainty: SupportsFloat, digits: int = 2) -> int:
    """Return the decimals that show so many digits of an uncertainty (GUM 7.2.6); below zero: tens, hundreds."""
    u = float(uncertainty)
    if not (math.isfinite(u) and u > 0):
        return 6
    exponent = int(f"{u:.{digits - 1}e}".partition("e")[2])  # of the rounded value: 9.97 is 10
    return digits - 1 - exponent


def fixed(value: SupportsFloat, places: int) -> str:
    """Return a figure with these decimals and a minus sign, but never a minus before nought; – for none."""
    number = float(value)
    if math.isinf(number):
        return "∞" if number > 0 else "−∞"
    if math.isnan(number):
        return "–"
    shown = round(number, places) + 0.0
    if places > MOST_DECIMALS and abs(shown) < 1e-6:
        return _with_power(shown, places) if shown else "0"
    return _with_power(shown, 0) if abs(shown) >= 1e15 else _decimal(shown, places)


def interval(ends: Iterable[SupportsFloat], places: int) -> str:
    """Return an interval with these decimals: 4.97 … 5.07."""
    return " … ".join(fixed(end, places) for end in ends)


def _decimal(number: float, places: int) -> str:
    return f"{number:.{max(places, 0)}f}".replace("-", "−")


def _with_power(number: float, places: int) -> str:
    """The figure as 1.4e−9, with the digits that so many decimals show; of a large one, two."""
    digits = places + math.floor(math.log10(abs(number))) if places else 1
    mantissa, _, exponent = f"{number:.{digits}e}".partition("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def rounded(value: SupportsFloat, uncertainty: SupportsFloat) -> str:
    """Return a figure to two digits of its uncertainty; to four of its own where that is nought or not known."""
    return fixed(value, decimals(uncertainty)) if _uncertain(uncertainty, value) else significant(value, 4)


def with_uncertainty(value: SupportsFloat, uncertainty: SupportsFloat, places: int | None = None) -> str:
    """Return a figure with its standard uncertainty or standard error, ``−30.644 ± 0.054``: two digits of it.

    Where it is nought or not known, the figure stands alone, with four digits.

    Args:
        value: the figure.
        uncertainty: of it, in the same unit.
        places: most decimals; what is uncertain by less than half of the last of them stands alone.
    """
    if abs(float(value)) < DUST and not float(uncertainty) >= DUST:
        return "0"
    is_uncertain = math.isfinite(value) and _uncertain(uncertainty, value)
    shown = decimals(uncertainty) if is_uncertain else decimals(abs(float(value)), 4)
    shown = shown if places is None else min(shown, places)
    after = fixed(uncertainty, shown) if is_uncertain else "0"
    if after.strip("0.") == "":
        return fixed(value, shown) if value else "0"
    suffix = f" ± {after}" if "e" in after or not _CONCISE.get() else _in_parentheses(after)
    return fixed(value, shown) + suffix


def beside_uncertainty(value: SupportsFloat, uncertainty: SupportsFloat, expanded: SupportsFloat | None = None) -> str:
    """Return a value that has its uncertainty in another column: without it, but for the concise notation.

    Args:
        value: the figure.
        uncertainty: its standard uncertainty, in the same unit.
        expanded: its expanded uncertainty, to whose digits it is rounded; None: to the standard uncertainty's.
    """
    if _CONCISE.get():
        return with_uncertainty(value, uncertainty)
    return rounded(value, uncertainty if expanded is None else expanded)


def finest(uncertainties: Iterable[SupportsFloat]) -> int:
    """Return the most decimals of a table: two more than the least uncertainty of its totals asks for."""
    return 2 + max((decimals(u) for u in uncertainties if _uncertain(u)), default=2)


def significant(value: SupportsFloat, digits: int = 3, *, signed: bool = False) -> str:
    """Return a figure with so many digits, its last noughts kept: 4.80 and 11.0 beside 5.02; ``signed``: +4.80."""
    number = float(value)
    shown = fixed(number, decimals(abs(number), digits)) if not abs(number) < DUST else "0"
    return f"+{shown}" if signed and number > 0 else shown


def common(values: Iterable[SupportsFloat], digits: int = 3) -> list[str]:
    """Return figures of one quantity with the same decimals: so many digits of the largest, but no less than units."""
    figures = [float(value) for value in values]
    largest = max((abs(value) for value in figures if math.isfinite(value)), default=0.0)
    return [fixed(value, max(decimals(largest, digits), 0) if largest else 0) for value in figures]


def exact(values: Iterable[SupportsFloat]) -> list[str]:
    """Return figures that count as exact: all digits that are stated, six at most, with the same decimals."""
    figures = [float(value) for value in values]
    most = decimals(max(map(abs, figures), default=0.0), 9)  # what is smaller comes from the arithmetic
    written = [_decimal(value, max(min(decimals(abs(value), 6), most), 0) if value else 0) for value in figures]
    needed = max((len(text.partition(".")[2].rstrip("0")) for text in written), default=0)
    return [fixed(value, needed) for value in figures]


def common_power(uncertainties: Iterable[SupportsFloat]) -> int:
    """Return the power of ten, a multiple of three, in which figures of an unnamed unit need few noughts.

    Nought where the largest uncertainty is between a thousandth and a million.
    """
    largest = max((float(u) for u in uncertainties if _uncertain(u)), default=1.0)
    return 0 if 1e-3 <= largest < 1e6 else 3 * math.floor(math.log10(largest) / 3)


def in_power(power: int) -> str:
    """Return the caption of a table whose figures are in a power of ten of their unit; "" for none."""
    return f"in 10{str(power).translate(SUPERSCRIPTS)} of the unit" if power else ""


def _uncertain(uncertainty: SupportsFloat, value: SupportsFloat = 0.0) -> bool:
    """Whether an uncertainty is known and more than the rounding of the arithmetic."""
    return math.isfinite(uncertainty) and float(uncertainty) > (
        ROUNDING * abs(float(value)) if math.isfinite(value) else 0
    )


def _in_parentheses(uncertainty: str) -> str:
    """The digits of an uncertainty below one, else all of it: (11) and (4.9)."""
    return f"({uncertainty if float(uncertainty) >= 1 else uncertainty.replace('.', '').lstrip('0')})"
