"""Weak runs: wide honest intervals, a warning that names what is missing, a body's tensor; never a confident wrong one."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

from identify.identification import identify
from identify.results.weak_components import within_bodies
from identify.rigid_body.principal_axes import is_admissible
from identify.signals.run import RunError
from tests.helpers import weak_lab as lab
from tests.helpers.changed_result import changed

ABOUT_ONE = (0, 1, 0)


def found(motion, seed=0, inertia=lab.ROD, **options):
    run = lab.run(inertia, motion, np.random.default_rng(seed))
    return identify(run, r_cg=lab.R_CG, estimator=lab.SMOOTH, **options)


def holds(result, inertia=lab.ROD):
    """A body's tensor, with intervals that hold the truth."""
    assert bool(is_admissible(jnp.asarray(result.inertia)))
    assert lab.covered(result, inertia).all()


@pytest.mark.parametrize("method", ["source", "gls"])
def test_one_axis_tells_three_components_and_bounds_the_rest(method, unjudged):
    result = found(lab.swing(30.0, ABOUT_ONE), method=method)
    holds(result)
    determined = result.admissible.determined
    np.testing.assert_array_equal(determined, [False, True, False, True, True, False])
    assert abs(result.inertia[3] - lab.ROD[3]) < 4 * result.standard_uncertainty[3]
    # |I13| ≤ I22 / 2 for every body; I11 and I33 have no upper bound
    assert result.interval95[2, 1] == pytest.approx(result.interval95[3, 1] / 2, rel=0.05)
    assert np.isinf(result.interval95[[0, 5], 1]).all()
    assert np.isnan(result.standard_uncertainty[[0, 5]]).all()
    (warning,) = [text for text in result.warnings if "not determined" in text]
    assert warning.startswith("I11, I13, I33 not determined: the body turns about one axis only, (0.00, 1.00, 0.00), ")
    assert "rotate about more axes" in warning


def test_what_is_open_can_be_written_and_read():
    result = found(lab.swing(30.0, ABOUT_ONE))
    content = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert content["interval95"]["I11"][1] is None
    assert content["standard_uncertainty"]["I33"] is None
    assert content["admissible"]["determined"] == {
        "I11": False, "I12": True, "I13": False, "I22": True, "I23": True, "I33": False
    }  # fmt: skip
    rows = {row[0]: row[1:5] for row in result.overview()[0].rows}
    assert rows["I11"] == rows["I13"] == rows["I33"] == ["–", "–", "–", "not determined by this motion"]
    assert "…" in rows["I22"][3]
    assert "∞" not in repr(result)


def test_an_estimate_near_the_edge_is_no_fault():
    """A plate, 1.5 standard uncertainties inside: the value stays, the intervals end at bodies; no warning."""
    plain = found(lab.swing(30.0), inertia=lab.ROD)
    plate, u = np.array([0.2, 0, 0, 0.2, 0, 0.39]), 4e-3
    ends = plate[:, None] + 2 * u * np.array([[-1, 1]])
    near = dataclasses.replace(plain, warnings=(), seen=None)
    near = changed(near, inertia=plate, covariance=u**2 * np.eye(6), interval95=ends)
    result = within_bodies(near, [])
    np.testing.assert_array_equal(result.inertia, plate)
    assert result.admissible is not None
    assert result.warnings == ()
    assert [text for text in result.notes() if text.startswith("physical limits: ")]


def test_an_axis_askew_tells_its_own_moment(unjudged):
    """No component alone, but uᵀIu: named with its value, two standard uncertainties at most from the truth."""
    axis = np.array([0.6, 0.64, 0.48])
    t, omega, alpha = lab.swing(30.0, ABOUT_ONE)
    result = found((t, omega[:, 1:2] * axis, alpha[:, 1:2] * axis))
    holds(result)
    (warning,) = [text for text in result.warnings if "not determined" in text]
    assert "(0.60, 0.64, 0.48), about which its moment is" in warning
    value, sigma = map(float, warning.split("its moment is ")[1].split(" g·m²")[0].split(" ± "))
    true = 1e3 * (axis**2 @ lab.ROD[[0, 3, 5]])
    assert abs(value - true) < 2.5 * sigma + 0.05


def test_axes_of_a_plane_leave_the_moment_across():
    result = found(lab.swing(30.0, (1, 0, 1)))
    holds(result)
    assert "poorly determined" in " ".join(result.warnings) or "in the plane normal" in " ".join(result.warnings)


def test_two_seconds_are_said_to_be_too_few():
    result = found(lab.swing(2.0), seed=1)
    holds(result)
    assert any("poorly determined" in text and "I22" in text for text in result.warnings)
    assert np.ptp(result.interval95[3]) > 0.5 * lab.ROD[3]


def test_a_thin_rods_tensor_is_a_bodys_and_the_plain_one_stands_beside(unjudged):
    """I22 a twentieth of the others, 3 s: where noise pushes the plain estimate out, the nearest body stands there."""
    seen = 0
    for seed in range(3):
        result = found(lab.swing(3.0), seed=seed)
        assert bool(is_admissible(jnp.asarray(result.inertia)))
        if result.admissible is None or bool(is_admissible(jnp.asarray(result.admissible.plain))):
            continue
        seen += 1
        assert "the value is that of the nearest body" in result.admissible.note
        assert not any("physically" in text for text in result.warnings)  # every second estimate of a body at the edge
        assert set(result.to_dict()["admissible"]) == {"reason", "determined", "distance", "plain_inertia",
                                                          "plain_interval95"}  # fmt: skip
    assert seen


def test_strong_data_are_left_alone():
    run = lab.run(np.array([0.30, 0.01, -0.02, 0.25, 0.01, 0.28]), lab.swing(60.0), np.random.default_rng(0))
    result = identify(run, r_cg=lab.R_CG, estimator=lab.SMOOTH)
    np.testing.assert_array_equal(within_bodies(result, run).interval95, result.interval95)
    assert result.admissible is None
    assert result.to_dict()["admissible"] is None


def test_a_contradiction_about_one_axis_is_refused():
    run = lab.run(-lab.ROD, lab.swing(30.0, (1, 0, 0)), np.random.default_rng(0))
    with pytest.raises(RunError, match="determines is physically impossible: check signs, frames and r_CG"):
        identify(run, r_cg=lab.R_CG, estimator=lab.SMOOTH)


def coverage(seconds, trials, axes=(1, 1, 1)):
    """Share of runs whose intervals hold the truth, by component; share of bodies; of those that were bounded."""
    rng, motion = np.random.default_rng(17), lab.swing(seconds, axes)
    held, bodies, bounded = [], [], []
    for _ in range(trials):
        result = identify(lab.run(lab.ROD, motion, rng), r_cg=lab.R_CG, estimator=lab.SMOOTH)
        held.append(lab.covered(result, lab.ROD))
        bodies.append(bool(is_admissible(jnp.asarray(result.inertia))))
        bounded.append(result.admissible is not None)
    return np.mean(held, axis=0), np.mean(bodies), np.mean(bounded)


def test_a_brief_runs_intervals_hold(unjudged):
    """The rod in 2 s, 8 runs x 6: binomial standard error at most 7.7 %."""
    held, bodies, _ = coverage(2.0, 8)
    assert held.mean() > 0.95 - 3 * 0.077
    assert bodies == 1.0


@pytest.mark.study
@pytest.mark.parametrize(
    ("seconds", "axes"), [(2.0, (1, 1, 1)), (4.0, (1, 1, 1)), (20.0, (1, 1, 1)), (20.0, (0, 1, 0))]
)
def test_coverage_of_weak_runs(seconds, axes):
    """300 runs: standard error 1.3 % of a component."""
    held, bodies, bounded = coverage(seconds, 300, axes)
    print(f"\n{seconds:g} s about {axes}: coverage {np.round(held, 3)}, bounded {bounded:.2f}")
    assert held.min() > 0.91
    assert bodies == 1.0
