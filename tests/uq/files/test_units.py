"""Values with units."""

import math

import pint
import pytest

from uq.files.units import USUAL, UnitError, quantity


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.38 N*m", "N*m", 0.38),
        ("4.3e-4 rad/s", "rad/s", 4.3e-4),
        ("53 mm", "m", 0.053),
        ("381.3 g*m^2", "kg*m^2", 0.3813),
        ("3 deg", "rad", math.radians(3)),
        ("90 deg/s", "rad/s", math.pi / 2),
        ("1 kg*m**2", "kg*m^2", 1.0),
        ("1 N*m*s^-1", "N*m/s", 1.0),
        ("1 Hz**0.5", "Hz**0.5", 1.0),
        ("2 mrad", "rad", 0.002),
        ("1 turn/s", "rad/s", 2 * math.pi),
        ("30 rpm", "rad/s", math.pi),
        ("0.4 kHz", "Hz", 400),
        ("3 min", "s", 180),
        ("5 lbf", "N", 22.2411081),
        ("-1.5 mm", "m", -0.0015),
    ],
)
def test_a_value_is_converted_once(text, unit, value):
    assert quantity(text, unit) == pytest.approx(value, rel=1e-8)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("5 Hz", "rad/s"),  # pint alone makes 5 rad/s of it
        ("5 1/s", "rad/s"),
        ("5 rad/s", "Hz"),
        ("5 N*m/rad", "N*m"),
        ("30 rpm", "Hz"),
        ("5", "rad"),  # an angle wants its unit
        ("5 N", "N*m"),
        ("5", "m"),
        (5, "m"),
        (5.0, "m"),
        (True, "m"),
        (None, "m"),
        ("", "m"),
        ("m", "mm "),
        ("five m", "m"),
        ("5 m m", "m"),
        ("nan m", "m"),
        ("inf m", "m"),
        ("5 N**9**9**9", "N"),
        ("5 N^99999", "N"),
        ("5 N*", "N"),
        ("5 quux", "m"),
        ("(5 m", "m"),
        ("5 m; 3", "m"),
        ("1/0 m", "m"),
    ],
)
def test_what_is_not_a_value_of_that_dimension_is_refused(text, unit):
    with pytest.raises(UnitError, match="write"):
        quantity(text, unit)


@pytest.mark.parametrize(("name", "unit"), USUAL)
def test_what_is_usual_is_what_pint_says(name, unit):
    registry = pint.UnitRegistry(cache_folder=None)
    assert (
        registry.Quantity(1, registry.parse_units(name)).to(registry.parse_units(unit)).magnitude == USUAL[name, unit]
    )
