"""The paper's Table 2: within statistics in a short campaign; in full, every acceptance figure (`make study`)."""

import numpy as np
import pytest

from uq.monte_carlo.barreto2016 import PRINTED, PRINTED_EFFECTS, PRINTED_SHARES, TRAJECTORIES, paper
from uq.report.tables.paper import effects, table2

ROWS = ("3σ moments", "% of nominal", "3σ products")


@pytest.fixture(scope="module")
def brief():
    return paper(trials=200, seed=3)


def check(result, figure, against, effect):
    """Every figure of Table 2, the differences to T4, shares and effects, within these tolerances."""
    table = result.table2("central")
    for row in ROWS:
        for name in TRAJECTORIES:
            assert table[row][name] == pytest.approx(PRINTED[row][name], rel=figure), (row, name)
    for row in ("moments against T4 %", "products against T4 %"):
        for name in ("T1", "T2", "T3"):
            assert table[row][name] == pytest.approx(PRINTED[row][name], abs=against), (row, name)
    for group, share in result.shares("central").items():
        assert share == pytest.approx(PRINTED_SHARES[group], abs=effect), group
    for name, change in result.effects("central").items():
        assert change == pytest.approx(PRINTED_EFFECTS[name][3], abs=effect), name


def test_a_brief_campaign_is_near_the_sources_figures(brief):
    # 3 % is the preset's; 200 trials add √(1/400) = 5 % per component, 3 % per average: four of these
    check(brief, figure=0.14, against=8, effect=11)


def test_mean_errors_of_the_central_difference_and_of_the_smoother(brief):
    central = {name: brief.campaign[name, "central"].total.mean_error for name in TRAJECTORIES}
    assert 1e3 * central["T1"][5] == pytest.approx(-30.5, abs=0.5)
    assert 1e3 * central["T3"][5] == pytest.approx(-71, abs=1)
    assert 1e3 * central["T1"][0] == pytest.approx(-1.7, abs=0.3)
    for name in TRAJECTORIES:
        smoothed = brief.campaign[name, "smoothed"].groups["imu"]
        total = brief.campaign[name, "smoothed"].total
        # of the IMU alone, so that the mean of 200 load-cell draws (0.07 of 3σ/3) does not drown it
        np.testing.assert_array_less(np.abs(smoothed.mean_error), 0.1 * total.three_sigma)


def test_the_rows_stand_beside_the_sources(brief):
    table = table2(brief, "central")
    head, rows = table.head, table.rows
    assert head == ["central", "T1", "paper", "T2", "paper", "T3", "paper", "T4", "paper"]
    assert [row[0] for row in rows] == list(PRINTED)
    assert [row[2] for row in rows] == ["2.82", "5.13", "−43.5", "1.86", "−46.4"]
    assert "smoothed" in repr(brief)
    assert brief.to_dict()["trials"] == 200


def test_no_table_is_the_sources_that_it_does_not_have(brief):
    """The paper has no smoothed estimator; the IMU's share, five times smaller with one, is explained there."""
    assert "of the paper" in table2(brief, "central").caption
    for table in (table2(brief, "smoothed"), effects(brief, "smoothed")):
        assert "of the paper" not in table.caption
        assert "no such estimator" in table.note
    assert "IMU" in effects(brief, "smoothed").note
    assert "fitted, not predicted" in " ".join(brief.section().assumptions)


@pytest.mark.study
def test_the_full_campaign_meets_every_figure():
    result = paper(trials=10_000)
    print(result)
    check(result, figure=0.03, against=2, effect=4)
    for name in TRAJECTORIES:
        smoothed = result.campaign[name, "smoothed"]
        np.testing.assert_array_less(np.abs(smoothed.total.mean_error), 0.1 * smoothed.total.three_sigma)
        # the same estimator with noise-free omega in the regressor: load cell and CG alone, added in squares
        silent = np.hypot(smoothed.groups["load_cell"].three_sigma, smoothed.groups["cg"].three_sigma)
        np.testing.assert_allclose(smoothed.total.three_sigma, silent, rtol=0.02)
