"""Values with units."""

import math
import re

import pint
import pytest

from uq.files.units import USUAL, UnitError, quantity, scale


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


@pytest.mark.parametrize(
    ("text", "unit", "meant"),
    [
        ("5 Nm", "N*m", "N*m"),
        ("5 nm", "N*m", "N*m"),  # a nanometre is a unit, of another dimension
        ("5 Nmm", "N*m", "N*mm"),
        ("5 kgm2", "kg*m^2", "kg*m^2"),
        ("5 gm^2", "kg*m^2", "g*m^2"),
        ("5 Newton", "N", "newton"),
        ("5 MM", "m", "mm"),
        ("5 dge/s", "rad/s", "deg/s"),
        ("5 m/s2", "m/s^2", "m/s^2"),
        ("5 lbm", "kg", "lb"),
        ("5 lb*in*s^2", "kg*m^2", "lbf*in*s^2"),
    ],
)
def test_a_misspelt_unit_is_recognised(text, unit, meant):
    with pytest.raises(UnitError, match=rf"did you mean {re.escape(meant)}\? write "):
        quantity(text, unit)


@pytest.mark.parametrize(
    ("text", "unit"), [("5 Hz", "rad/s"), ("5 N", "N*m"), ("5 bananas", "N"), ("5", "m"), ("", "m"), ("inf m", "m")]
)
def test_nothing_is_guessed_of_what_is_like_no_unit(text, unit):
    with pytest.raises(UnitError) as error:
        quantity(text, unit)
    assert "did you mean" not in str(error.value)


def test_the_name_of_a_unit_alone_has_the_hint_too():
    with pytest.raises(UnitError, match=r"is 'Nm': did you mean N\*m\? write the name of a unit"):
        scale("Nm", "N*m")


@pytest.mark.parametrize(("name", "unit"), USUAL)
def test_what_is_usual_is_what_pint_says(name, unit):
    registry = pint.UnitRegistry(cache_folder=None)
    assert (
        registry.Quantity(1, registry.parse_units(name)).to(registry.parse_units(unit)).magnitude == USUAL[name, unit]
    )
