"""Figures have the digits of their uncertainty: compared with exact fractions of what is printed."""

import math
from fractions import Fraction

from hypothesis import assume, example, given
from hypothesis import strategies as st

from identify.display.rounding import (
    beside_uncertainty,
    common,
    concise,
    exact,
    finest,
    fixed,
    rounded,
    significant,
    with_uncertainty,
)
from identify.display.text_tables import is_figure

values = st.floats(-1e9, 1e9)


uncertainties = st.floats(1e-9, 1e9)


def printed(text):
    """The number that a text shows, exactly, and the size of its last decimal."""
    plain = text.replace("−", "-")
    mantissa, _, exponent = plain.partition("e")
    return Fraction(plain), Fraction(10) ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def assert_rounded(text, value, unit):
    """The text is the nearest multiple of ``unit``; a tie may go either way."""
    number, last = printed(text)
    assert number % unit == 0
    assert abs(number - Fraction(value)) <= unit / 2
    assert last >= min(unit, 1)  # no decimal beyond the place that counts
    assert not text.startswith("−0") or number != 0


@given(values, uncertainties)
@example(50000838.2, 31.7)
@example(4.8, 0.0996)
@example(-1e-9, 9.96)
@example(11.0, 0.0995)
def test_a_value_has_the_place_of_the_second_digit_of_its_uncertainty(value, u):
    assume(u > 1e-9 * abs(value))  # less is the rounding of the arithmetic
    shown, _, beside = with_uncertainty(value, u).partition(" ± ")
    # Two digits: the printed uncertainty is 10 to 99 units of its last place that counts.
    number, last = printed(beside)
    unit = last if last < 1 else next(Fraction(10) ** k for k in range(12) if number < 100 * Fraction(10) ** k)
    assert 10 * unit <= number < 100 * unit
    assert_rounded(beside, u, unit)
    assert_rounded(shown, value, unit)
    assert rounded(value, u) == beside_uncertainty(value, u) == shown
    assert is_figure(with_uncertainty(value, u))


@given(values, uncertainties)
@example(5.02, 1.1)
@example(0.5, 0.99999)
def test_concise_notation_says_the_same(value, u):
    assume(u > 1e-9 * abs(value))
    plain, _, beside = with_uncertainty(value, u).partition(" ± ")
    with concise():
        text = with_uncertainty(value, u)
        assert beside_uncertainty(value, u) == text
    assert is_figure(text)
    if "e" in beside:  # a power of ten has no place for parentheses
        assert text == with_uncertainty(value, u)
        return
    shown, _, digits = text.rstrip(")").partition("(")
    assert shown == plain
    places = len(shown.partition(".")[2])
    in_last_digits = Fraction(digits) / 10 ** (0 if "." in digits else places)
    assert in_last_digits == Fraction(beside)
    assert with_uncertainty(value, u) == f"{plain} ± {beside}"


def test_what_a_table_need_not_show_is_rounded_away():
    assert with_uncertainty(-0.00004, 0.00003, finest([0.30, 0.18])) == "0.0000"
    assert with_uncertainty(-0.0044, 0.00031, finest([0.30, 0.18])) == "−0.0044 ± 0.0003"
    assert with_uncertainty(-0.05, 0.30, finest([0.30, 0.18])) == "−0.05 ± 0.30"
    assert with_uncertainty(0.0044, 0.0, 2) == "0.00"
    assert finest([math.nan, 0.0]) == finest([]) == 4


@given(st.floats(1e-9, 1e9) | st.floats(-1e9, -1e-9), st.integers(1, 6))
def test_so_many_digits_noughts_kept(value, digits):
    text = significant(value, digits)
    number, last = printed(text)
    exponent = next(k for k in range(-12, 12) if abs(number) < Fraction(10) ** (k + 1))
    unit = Fraction(10) ** (exponent + 1 - digits)
    assert_rounded(text, value, unit)
    assert last == min(unit, 1)


def test_a_column_has_a_common_format():
    assert significant(8.9e-15) == significant(0.0) == "0"
    assert [significant(x) for x in (4.8, 11.0, 5.02)] == ["4.80", "11.0", "5.02"]
    assert common([-0.019, 4.594e-6, -0.3818], 4) == ["−0.0190", "0.0000", "−0.3818"]
    assert common([4.8, 11.0, math.nan]) == ["4.8", "11.0", "–"]
    assert common([5.00008e7, 31.7]) == ["50000800", "32"]
    assert common([0.0, 0.0]) == ["0", "0"]
    assert exact([381.3, 0.0, 18.5]) == ["381.3", "0.0", "18.5"]
    assert exact([19.7]) == ["19.7"]
    assert exact([50000838.0]) == ["50000838"]
    assert exact([1e3 * 0.3813, 1e-17]) == ["381.3", "0.0"]


def test_no_minus_before_nought():
    assert fixed(-0.0004, 3) == "0.000"
    assert fixed(-0.0005001, 3) == "−0.001"
