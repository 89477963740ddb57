"""Datasheet figures: each usual form is the distribution that the GUM reads in it; what is unclear is refused."""

import numpy as np
import pytest
from scipy import stats

from uq.files.units import UnitError
from uq.sources.datasheet import datasheet
from uq.sources.distributions import Normal, Rectangular, StudentT, Triangular, UShaped

FULL_SCALE = {"full_scale": 400.0}


@pytest.mark.parametrize(
    ("text", "options", "kind", "deviation"),
    [
        ("±0.5 % of full scale, k = 2", FULL_SCALE, Normal, 1.0),
        ("±0.5 % of the full scale (k=2)", FULL_SCALE, Normal, 1.0),
        ("0.1 % FS", FULL_SCALE, Rectangular, 0.4 / np.sqrt(3)),
        ("±0.1%FS", FULL_SCALE, Rectangular, 0.4 / np.sqrt(3)),
        ("< 0.1 % F.S.O.", FULL_SCALE, Rectangular, 0.4 / np.sqrt(3)),
        ("0.25 % of span, rectangular", FULL_SCALE, Rectangular, 1 / np.sqrt(3)),
        ("0.5 % of reading", {"reading": 100.0}, Rectangular, 0.5 / np.sqrt(3)),
        ("±2 N, 95 %", {}, Normal, 2 / stats.norm.ppf(0.975)),
        ("±2N (99 % confidence)", {}, Normal, 2 / stats.norm.ppf(0.995)),
        ("±2 N (k = 2, 95 %)", {}, Normal, 1.0),
        ("±2 N (95 %, k = 2)", {}, Normal, 1.0),
        ("±2 N, 95 %, 9 degrees of freedom", {}, StudentT, 2 / stats.t.ppf(0.975, 9) * np.sqrt(9 / 7)),
        ("expanded uncertainty 2 N, k = 2.26, ν = 9", {}, StudentT, 2 / 2.26 * np.sqrt(9 / 7)),
        ("accuracy ±2 N", {}, Rectangular, 2 / np.sqrt(3)),
        ("Accuracy: ±2000 mN", {}, Rectangular, 2 / np.sqrt(3)),
        ("max. 2 N", {}, Rectangular, 2 / np.sqrt(3)),
        ("±2 N, triangular", {}, Triangular, 2 / np.sqrt(6)),
        ("±2 N (u-shaped)", {}, UShaped, 2 / np.sqrt(2)),
        ("resolution 0.01 N", {}, Rectangular, 0.005 / np.sqrt(3)),
        ("0.01 N resolution", {}, Rectangular, 0.005 / np.sqrt(3)),
        ("0.2 N rms", {}, Normal, 0.2),
        ("0.2 N (1σ)", {}, Normal, 0.2),
        ("3 sigma = 1.5 N", {}, Normal, 0.5),
        ("standard uncertainty 0.2 N", {}, Normal, 0.2),
        ("1e-3 kN, k=2", {}, Normal, 0.5),
    ],
)
def test_usual_forms(text, options, kind, deviation):
    found = datasheet(text, "N", **options)
    assert type(found) is kind
    assert float(found.standard_deviation) == pytest.approx(deviation, rel=1e-12)
    assert float(found.mean) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.1 % FS", "is '0.1 % FS': give the full scale too"),
        ("0.1 % of reading", "give the reading too"),
        ("0.5 %", "write a figure in N or in % of full scale"),
        ("2", "write a figure in N or in % of full scale"),
        ("±2 kg", "write a figure in N or in % of full scale"),
        ("±2 N per K", "write a figure in N or in % of full scale"),
        ("±2 N/K", "write a figure in N or in % of full scale"),
        ("typical 2 N", "write a figure in N or in % of full scale"),
        ("-2 N", "write zero or more"),
        ("±2 N, normal", "a normal error needs a coverage factor or a level"),
        ("±2 N, k = 0", "write a coverage factor above zero"),
        ("±2 N, 5 %", "a level from 50 % to below 100 %"),
        ("±2 N, 100 %", "a level from 50 % to below 100 %"),
        ("±2 N, k = 2, rectangular", "a coverage factor goes with a normal error"),
        ("±2 N, 9 degrees of freedom", "a coverage factor goes with a normal error"),
        ("±2 N, in the mean", "'in the mean' is not understood"),
        ("", "write a figure in N"),
        (2.0, "write a statement such as"),
    ],
)
def test_what_is_unclear_is_refused(text, message):
    with pytest.raises(UnitError, match=message) as caught:
        datasheet(text, "N")
    assert "\n" not in str(caught.value)
