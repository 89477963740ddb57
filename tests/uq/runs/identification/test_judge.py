"""Runs from files before the judge: declared errors are no news, a turned load cell and the end of a range are said."""

import numpy as np
import pytest

from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.laboratory import FULL_SCALE, measure
from tests.helpers.laboratory_files import identified_files, source
from tests.helpers.laboratory_mechanics import R_CG
from tests.helpers.laboratory_runs import identified
from tests.helpers.troubles import TROUBLES
from uq.runs.recorded.time_window import TimeWindow

SHORT = {"seconds": 15.0}


def ten_of(measured):
    """Mass, r_CG and tensor of the laboratory's body."""
    return np.concatenate([[measured.setup.mass], R_CG, measured.truth])


@pytest.mark.parametrize(("clipped", "named"), [pytest.param(0.0, False, marks=pytest.mark.slow), (0.1, True)])
def test_the_end_of_a_sensors_range_is_said_of_a_file(tmp_path, clipped, named):
    """Stamps of a file are rounded, so that samples of one value differ by 1e-7 of the range."""
    measured = measure(0, **TROUBLES["clipping"].options(clipped, 0), **SHORT)
    causes = {verdict.cause for verdict in identified_files(measured, tmp_path).consistency}
    assert ("saturation" in causes) == named


def test_a_declared_error_is_no_news(tmp_path, few_draws):
    talk = 5e-3 * np.random.default_rng(3).standard_normal((6, 6)) * (1 - np.eye(6))
    measured = measure(1, cross_talk=talk * FULL_SCALE[:, None] / FULL_SCALE, **SHORT)
    undeclared = identified_files(measured, tmp_path, "source")
    declared = identified_files(measured, tmp_path, "source", [source("c", "wrench", "cross_talk", 5e-3)])
    assert undeclared.consistency[0].cause == "cross-talk"
    assert declared.consistency == ()
    assert "model misfit" in undeclared.contributions
    assert "model misfit" not in declared.contributions
    total = np.sqrt(sum(np.square(row) for row in undeclared.contributions.values()))
    np.testing.assert_allclose(total, undeclared.standard_uncertainty, rtol=1e-3)


@pytest.mark.parametrize("method", [pytest.param("source", marks=pytest.mark.study), "joint"])
@pytest.mark.parametrize(
    ("error", "target", "kind", "size"),
    [
        ({"imu_delay": 3e-3}, "omega", "delay", 2e-3),
        pytest.param({"imu_turn": (0, 0, 13.5e-3)}, "omega", "misalignment", [4e-3] * 3, marks=pytest.mark.slow),
        ({"gyro_turn": (4e-3, -8e-3, 6e-3)}, "omega", "misalignment", [6e-3] * 3),
    ],
)
def test_a_declared_turn_or_delay_of_imu_or_gyro_is_no_news(tmp_path, few_draws, method, error, target, kind, size):
    measured = measure(4, **error, **SHORT)
    result = identified_files(measured, tmp_path, method, [source("declared", target, kind, size)])
    assert result.consistency == ()
    assert not [text for text in result.warnings if "run0" in text]
    off = np.abs(result.parameters.values - ten_of(measured))
    half = result.coverage_factors * result.parameters.standard_uncertainty
    assert (off[1:] < 2 * half[1:]).all()
    if "gyro_turn" in error and method == "joint":
        assert (half[1:4] > 1.5 * identified(measured, method).sigma_r_cg).all()
        assert result.contributions["declared"].any()


def test_a_load_cell_that_is_turned_is_said_though_its_residuals_are_clean(tmp_path):
    """The motion cannot tell whether IMU or load cell is turned; the tensor in the load cell's axes is what is given."""
    turn = np.array([2e-3, -4e-3, 3e-3])
    measured = measure(3, cell_turn=tuple(turn), **SHORT)
    result = identified(measured, "joint")
    first = result.warnings[0]
    assert "if the load cell is the rotated one" in first
    error = 1e3 * (measured.truth - result.inertia)[COMPONENTS.index(first.split("rotated one, ")[1][:3])]
    told = float(first.split("changes by ")[1].split()[0].replace("−", "-"))
    assert told == pytest.approx(error, abs=0.15)
    declared = identified_files(measured, tmp_path, "joint", [source("axes", "wrench", "misalignment", [4e-3] * 3)])
    assert declared.warnings == ()
    assert (np.abs(declared.inertia - measured.truth) < np.ptp(declared.interval95, axis=1)).all()


def test_two_shapes_of_one_cause_are_no_rivals():
    direction = 5 * np.array([1, 0.5, 0.3, 0.03, 0.02, 0.01])
    (text,) = identified(measure(1, warming=tuple(direction), warming_time=20.0)).warnings
    assert "the load cell's zeros drifted as it warmed up (drift); let it warm up" in text


@pytest.mark.parametrize(
    ("time", "size", "seconds"),
    [
        (90.0, 3.0, 15.0),
        *(pytest.param(*case, 30.0, marks=pytest.mark.slow) for case in ((180.0, 3.0), (40.0, 3.0), (6.0, 12.0))),
    ],
)
def test_a_zero_that_warms_up_is_a_drift_whose_cures_lead_to_the_truth(tmp_path, few_draws, time, size, seconds):
    direction = size * np.array([0.6, 0.5, 0.6, 0.018, 0.015, 0.018])
    measured = measure(1, warming=tuple(direction), warming_time=time, seconds=seconds)
    result = identified_files(measured, tmp_path)
    assert [verdict.cause for verdict in result.consistency] == ["drift"]
    assert "the load cell's zeros drifted" in result.warnings[0]
    assert ("as it warmed up" in result.warnings[0]) == (time < 10)  # else nearly straight, which is simpler
    declared = [
        source("F_drift", "F", "drift", [size / seconds] * 3),
        source("M_drift", "M", "drift", [0.03 * size / seconds] * 3),
    ]
    obeyed = [identified_files(measured, tmp_path, sources=declared)]
    if seconds > 20:
        warm = identified_files(measure(1), tmp_path)
        assert not warm.warnings
        obeyed += [identified_files(measured, tmp_path, windows=[TimeWindow(15.0)]), warm]
    for answer in (result, *obeyed):
        assert (np.abs(answer.inertia - measured.truth) < np.ptp(answer.interval95, axis=1) / 2).all()
        assert np.ptp(answer.interval95, axis=1).max() < 4e-3
    assert time < 10 or not obeyed[0].warnings
