"""Errors and quantities that an estimate takes as declared: derivatives by them, and what the runs say of them."""

import numpy as np
import pytest

from identify.estimation.joint.joint_model import COUNT, SLICES, TEN
from identify.estimation.joint.prior_departure import FAR
from identify.estimation.joint.priors import ConstantError, Prior, indices
from identify.estimation.methods.base import Problem
from identify.judge.held_errors import departing_declarations, pooled_change
from identify.judge.run_fit import RunFit
from identify.results.declaration import CONTRADICTED, contradiction
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_mechanics import MASS
from tests.helpers.laboratory_runs import identified

PLACES = {"r_cg": slice(0, 3), "inertia": slice(3, 9), "moment_offset": slice(9, 12)}
SIGMA = np.array([0.1, 0.2, 0.3])


def fit_of(columns):
    """A run's fit in white noise with nothing but its columns and its prior, which knows r_CG alone."""
    root = np.zeros((COUNT, 12))
    for name, where in PLACES.items():
        root[SLICES[name], where] = np.diag(SIGMA) if name == "r_cg" else np.eye(where.stop - where.start)
    fit = object.__new__(RunFit)
    prior = Prior(np.zeros(COUNT), root, np.array([1.0] * 3 + [0.0] * 9))
    for name, value in (("columns", columns), ("prior", prior), ("weights", np.eye(12))):
        object.__setattr__(fit, name, value)
    return fit


def test_runs_share_the_body_and_its_prior_and_have_their_own_offsets():
    """Least squares on the rows of both runs and one prior of r_CG, an offset for each run: the same to rounding."""
    rng = np.random.default_rng(5)
    columns, added = (rng.standard_normal((2, 40, 6, count)) for count in (12, 4))
    shift = pooled_change([fit_of(of_run) for of_run in columns], list(added), {"r_cg", "inertia"})[indices(TEN)]
    rows, sides = columns.reshape(2, 240, 12), added.reshape(2, 240, 4)
    apart = [np.hstack([run[:, :9], *(run[:, 9:] * (k == own) for own in (0, 1))]) for k, run in enumerate(rows)]
    prior = np.eye(3, 15)
    together = np.linalg.lstsq(np.vstack([*apart, prior]), np.vstack([*sides, np.zeros((3, 4))]))[0]
    expected = np.vstack([np.zeros((1, 4)), SIGMA[:, None] * together[:3], together[3:9]])
    np.testing.assert_allclose(shift, expected, atol=1e-12)


SIGMA = np.array([0.1, 0.2, 0.3])
PLACES = {"r_cg": slice(0, 3), "inertia": slice(3, 9), "moment_offset": slice(9, 12)}
SHORT = {"seconds": 15.0}


def linear_fit(columns, rows, start):
    """A run's fit of linear rows in white noise, stopped at some coordinates, with a prior of r_CG about (1, 2, 3)."""
    root, mean = np.zeros((COUNT, 12)), np.zeros(COUNT)
    for name, where in PLACES.items():
        root[SLICES[name], where] = np.diag(SIGMA) if name == "r_cg" else np.eye(where.stop - where.start)
    mean[SLICES["r_cg"]] = [1, 2, 3]
    fit = object.__new__(RunFit)
    parts = {
        "columns": columns, "best": start, "residuals": rows - columns @ start,
        "prior": Prior(mean, root, np.array([1.0] * 3 + [0.0] * 9)), "weights": np.eye(12),
    }  # fmt: skip
    for name, value in parts.items():
        object.__setattr__(fit, name, value)
    return fit


def test_runs_tell_a_declared_quantity_together():
    """Two runs with an offset each: r_CG is that of one least squares of all rows, wherever the fits have stopped."""
    rng = np.random.default_rng(7)
    columns, truth = rng.standard_normal((2, 40, 6, 12)), np.array([1.0, 6.0, -1.0, *rng.standard_normal(9)])
    rows = columns @ truth + 0.1 * rng.standard_normal((2, 40, 6))
    fits = [linear_fit(*parts, rng.standard_normal(12)) for parts in zip(columns, rows, strict=True)]
    problem = Problem((), r_cg=np.array([1.0, 2, 3]), sigma_r_cg=SIGMA)
    (told,) = departing_declarations(problem, fits, [])
    flat = columns.reshape(2, 240, 12)
    apart = [np.hstack([run[:, :9], *(run[:, 9:] * (k == own) for own in (0, 1))]) for k, run in enumerate(flat)]
    sides = np.concatenate([rows.ravel(), np.zeros(3)])
    best = np.linalg.lstsq(np.vstack([*apart, np.eye(3, 15)]), sides)[0]
    assert (told.quantity, told.axis, told.declared, told.standard_uncertainty) == ("r_cg", 2, 2.0, 0.2)
    assert told.value == pytest.approx(2.0 + 0.2 * best[1], rel=1e-9)
    assert told.distance == pytest.approx(abs(best[1]), rel=1e-9)
    assert FAR < CONTRADICTED < told.distance
    assert contradiction([told]) == f"the runs contradict what is declared of {told.name} ({told.distance:.1f} u off)"
    near = told._replace(value=told.declared + 4.9 * told.standard_uncertainty)
    assert contradiction([near]) == ""


@pytest.mark.parametrize(
    ("method", "sigma", "quantities"),
    [
        ("source", 0.001, ["mass"]),
        ("gls", 0.0, []),
        pytest.param("gls", 0.02, None, marks=pytest.mark.slow),
        ("joint", 0.001, ["mass"]),
        pytest.param("joint", 0.0, [], marks=pytest.mark.slow),
    ],
)
def test_a_mass_that_is_declared_wrong_is_named(method, sigma, quantities):
    """1 % too large: named where it counts as exact, contradicted where u is 0.1 %, no news where u is 2 %."""
    measured = measure(4, mass_error=0.01 * MASS, **SHORT)
    result = identified(measured, method, mass_uncertainty=sigma * MASS or None)
    assert [record.quantity for record in result.declarations if record.contradicted] == (quantities or [])
    named = [text for text in result.warnings if "the mass" in text]
    assert len(named) == (quantities is not None)
    assert all(("(mass)" if sigma == 0 else "the mass comes to 19.7") in text for text in named)
    assert not any("centre of gravity" in text for text in result.warnings)
    for record in result.declarations:
        assert record.value == pytest.approx(MASS, abs=sigma * MASS)


def test_a_delay_that_is_declared_wrong_is_contradicted():
    late = ConstantError("delay", np.zeros(1), np.array([[1e-8]]))
    measured = measure(3, imu_delay=2e-3, **SHORT)
    (told,) = identified(measured, "source", errors={"late": late}).declarations
    assert told.value == pytest.approx(2e-3, abs=1e-4)
    assert told.distance == pytest.approx(20, abs=1)
