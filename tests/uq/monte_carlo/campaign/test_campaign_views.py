"""A campaign in a notebook: its parts show themselves in units, its samples come as an array with names."""

import re
import sys

import numpy as np
import pytest

from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.small_campaign import TRIALS, campaign

PAIRS = "('T1', 'central'), ('T1', 'smoothed')"


@pytest.fixture(scope="module")
def result():
    return campaign("T1")


@pytest.mark.parametrize("key", ["T9", "T1", ("T9", "central"), ("T1", "best")])
def test_an_unknown_key_is_answered_with_those_that_there_are(result, key):
    with pytest.raises(KeyError, match=f"^{re.escape(f'no {key!r}: choose one of {PAIRS}')}$"):
        result[key]


def test_unknown_names_elsewhere(result):
    with pytest.raises(KeyError, match=f"choose one of {re.escape(PAIRS)}$"):
        result.interval("T9", "central")
    with pytest.raises(KeyError, match=r"^no 'gyro': choose one of 'total', 'load_cell', 'cg', 'imu', 'F_precision', "):
        result["T1", "central"].share("gyro")
    with pytest.raises(KeyError, match=r"^no 'bars': choose one of 'breakdown-T1-central', "):
        result.figures()["bars"]


def test_completion_offers_keys_and_what_matters(result):
    assert result._ipython_key_completions_() == [("T1", "central"), ("T1", "smoothed")]
    assert "breakdown-T1-central" in result.figures()._ipython_key_completions_()
    assert {"figures", "tables", "to_frame", "to_xarray", "interval", "breakdowns"} <= set(dir(result))
    assert not {"section", "details", "overview", "notes", "file_name", "hidden"} & set(dir(result))


def test_a_breakdown_and_its_statistics_show_themselves_in_gram(result):
    breakdown = result["T1", "central"]
    total, bias = breakdown.total, 1e3 * breakdown.total.mean_error[5]
    text = repr(total)
    assert text.splitlines()[0].split() == ["g·m²", *COMPONENTS]
    shown = float(text.splitlines()[2].split("  ")[-1].split("±")[0].replace("−", "-"))
    assert shown == pytest.approx(bias, abs=1e3 * total.mean_error_standard_error[5])
    assert len(text.splitlines()) == 4
    rows = repr(breakdown).splitlines()
    assert rows[0].split() == ["alone", "g·m²", *COMPONENTS, "share", "%"]
    assert [row.split()[0] for row in rows[2::2]] == list(breakdown.cases)
    assert rows[3].split()[-1] == "100"
    assert "<table>" in breakdown._repr_html_()


def test_a_breakdown_is_part_of_the_frame(result):
    frame = result["T1", "smoothed"].to_frame()
    assert frame.equals(result.to_frame().loc["T1", "smoothed"])
    assert frame.loc[("imu", "I33"), "three_sigma [kg·m²]"] == result["T1", "smoothed"].groups["imu"].three_sigma[5]


def test_the_samples_come_as_an_array_with_names(result):
    """Oracle: the statistics of each case, computed from the samples once more."""
    pytest.importorskip("xarray")
    samples = result.to_xarray()
    assert samples.dims == ("trajectory", "trial", "estimator", "case", "component")
    assert samples.attrs["units"] == "kg m2"
    for pair in result.pairs():
        for case, statistics in result[pair].cases.items():
            of_case = samples.sel(trajectory=pair[0], estimator=pair[1], case=case)
            np.testing.assert_allclose(of_case.mean("trial"), statistics.mean_error, atol=1e-12)
            np.testing.assert_allclose(3 * of_case.std("trial", ddof=1), statistics.three_sigma, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(samples.true_tensor, result.nominal)
    assert samples.sel(component="I33", case="total").sizes == {"trajectory": 1, "trial": TRIALS, "estimator": 2}


def test_without_xarray_one_line_says_so(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ModuleNotFoundError, match=r"^xarray is missing for to_xarray\(\): pip install xarray$"):
        result.to_xarray()
