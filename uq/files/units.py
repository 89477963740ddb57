"""Physical values with their units, converted once at the edge: ``"0.38 N*m"`` to a float in SI.

An angle is a dimension of its own here, so ``"5 Hz"`` is not taken for 5 rad/s, nor ``"1/s"`` for rad/s.
"""

import re
import tokenize
from functools import cache
from typing import Any

from rig.exceptions import nearest, quoted

UNIT = re.compile(r"[A-Za-zµΩ°%_]([\w*/^.µΩ° ()-]*[\w)µΩ°])?")
"""Pattern of a unit's name; ``1/s`` is written Hz or s^-1."""


POWER = re.compile(r"(\*\*|\^)(?!-?\d(\.\d)?([\s*/)]|$))|\d\s*(\*\*|\^)")
"""Pattern of a power that no unit has: of more than one digit, or of another power."""


USUAL = {
    ("mm", "m"): 0.001,
    ("g", "kg"): 0.001,
    ("g*m^2", "kg*m^2"): 0.001,
    ("ms", "s"): 0.001,
    ("deg", "rad"): 0.017453292519943295,
    ("deg/s", "rad/s"): 0.017453292519943295,
}
"""Conversion factors of usual units, as pint has them, so that most experiment files are read without pint."""


WRITTEN = (
    "N", "kN", "N*m", "N*mm", "kg", "g", "m", "mm", "um", "s", "ms", "us", "min", "Hz", "kHz", "rad", "mrad", "deg",
    "rad/s", "deg/s", "deg/hour", "rpm", "m/s", "m/s^2", "mm/s^2", "kg*m^2", "g*m^2", "kg*mm^2", "kg/m^3", "%", "ppm",
)  # fmt: skip
"""Units of rig descriptions, one of which is suggested for a misspelt unit."""
SPELLING = str.maketrans("²³", "23", "*·⋅^() ")
"""Characters in which the spellings of one unit differ."""


POUND = re.compile(r"\blb[mfs]?\b")
"""Pattern of a pound, as it is written for mass or force."""
UNREADABLE = (tokenize.TokenError, ArithmeticError, TypeError, ValueError, AttributeError, SyntaxError)
"""Errors that pint raises for a text that it cannot read, beside pint.PintError."""

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
"""Pattern of a number. Python would also accept 1_0, inf and the digits of other scripts."""
LARGEST = 1e30
"""Value that no quantity of a rig reaches, in any unit: its square is still a number."""
LONGEST = 60
"""Most characters of a unit, and of a number: pint takes minutes over a name of 100,000 letters."""


class UnitError(ValueError):
    """A value that is not a number with a unit of the asked dimension."""


class DimensionError(ValueError):
    """A unit of another dimension than the one that is asked."""


@cache
def _registry() -> Any:
    import pint  # takes a third of a second: not before a unit beside the usual is read

    return pint.UnitRegistry(cache_folder=None)


def quantity(text: object, unit: str) -> float:
    """Return a value written with its unit, in ``unit``.

    Args:
        text: a number and a unit, such as ``"4.3e-4 rad/s"``.
        unit: the unit of the result, which gives the dimension that is asked.

    Raises:
        UnitError: ``text`` is a bare number, not a number with a unit, not finite, or of another dimension.
    """
    if not isinstance(text, str):
        raise UnitError(f'is {quoted(text)}: write a value with its unit, such as "1 {unit}"')
    number, _, name = text[: 4 * LONGEST].strip().partition(" ")
    try:
        if len(number) > LONGEST or not NUMBER.fullmatch(number):
            raise ValueError("no number, or more digits than any measurement has")
        value = float(number) * _factor(name.strip(), unit)
    except DimensionError:
        meant = _meant(name.strip(), unit, is_unit=True)
        raise UnitError(f"is {quoted(text)}: {meant}write a unit of the same dimension as {unit}") from None
    except UNREADABLE:
        meant = _meant(name.strip(), unit)
        raise UnitError(f'is {quoted(text)}: {meant}write a number, a space and a unit, such as "1 {unit}"') from None
    if not abs(value) < LARGEST:
        raise UnitError(f"is {quoted(text)}: write a number below 1e30, and a unit")
    return value


def scale(name: str, unit: str) -> float:
    """Return how many ``unit`` one of the unit ``name`` is; ``g`` as an acceleration is standard gravity, not gram.

    Raises:
        UnitError: ``name`` is no unit, or of another dimension.
    """
    try:
        return _factor("standard_gravity" if (name, unit) == ("g", "m/s^2") else name, unit)
    except DimensionError:
        meant = _meant(name, unit, is_unit=True)
        raise UnitError(f"is {quoted(name)}: {meant}write the name of a unit of the same dimension as {unit}") from None
    except UNREADABLE:
        raise UnitError(f"is {quoted(name)}: {_meant(name, unit)}write the name of a unit, such as {unit}") from None


def printed(unit: str) -> str:
    """Return a unit as it is printed: ``N·m`` of ``N*m``, ``m/s²`` of ``m/s^2``, ``s^½`` of ``s**0.5``."""
    return unit.replace("**0.5", "^½").replace("*", "·").replace("^2", "²")


def _meant(name: str, unit: str, *, is_unit: bool = False) -> str:
    """``did you mean …? `` of a unit of the asked dimension; ``is_unit``: of another dimension."""
    if _fits(name, unit):
        return ""  # it is the number that cannot be read
    for pound in ("lb", "lbf"):  # of mass, or of force
        candidate = POUND.sub(pound, name)
        if candidate != name and _fits(candidate, unit):
            return f"did you mean {candidate}? "
    names = [candidate for candidate in (unit, name.lower(), *WRITTEN) if _fits(candidate, unit)]
    for candidate in names:
        if candidate.translate(SPELLING).casefold() == name.translate(SPELLING).casefold():
            return f"did you mean {candidate}? "
    return "" if is_unit else nearest(name, names)


def _fits(name: str, unit: str) -> bool:
    try:
        return _factor(name, unit) > 0
    except (DimensionError, *UNREADABLE):
        return False


@cache
def _factor(name: str, unit: str) -> float:
    """Return the number of ``unit`` in one of the unit ``name``."""
    if len(name) > LONGEST or not UNIT.fullmatch(name) or POWER.search(name):
        raise ValueError(f"{quoted(name)} is not a unit")
    if name == unit:
        return 1.0
    if (name, unit) in USUAL:
        return USUAL[name, unit]
    registry = _registry()
    import pint

    try:
        given, asked = registry.parse_units(name), registry.parse_units(unit)
        if _angle(given) != _angle(asked):
            raise DimensionError(name)
        return float(registry.Quantity(1, given).to(asked).magnitude)
    except pint.DimensionalityError:
        raise DimensionError(name) from None
    except pint.PintError:
        raise ValueError(f"{quoted(name)} is not a unit") from None


def _angle(unit: Any) -> float:
    """The power of radian in a unit: 1 in rpm and deg/s, 0 in Hz."""
    powers: dict[str, Any] = dict(_registry().get_root_units(unit)[1]._units)
    return float(powers.get("radian", 0))
