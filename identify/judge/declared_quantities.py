"""Comparison of declared quantities with the runs, where the estimator takes them as declared."""

from collections.abc import Iterable, Sequence

import numpy as np

from identify.joint.prior_departure import FAR, declaration, departures
from identify.judge.evidence import Evidence
from identify.judge.findings import Finding
from identify.judge.held_errors import pooled_change, shared_unknowns
from identify.judge.run_fit import RunFit
from identify.methods.base import Problem
from identify.results.declaration import Declaration

TYPICAL_MASS = 0.005
"""Standard uncertainty over the mass that a mass declared without one counts with.

Prior: typical gains of force and accelerometer, error of gravity and of a scale together, as `[undeclared]` has them.
"""
TYPICAL_CENTRE = 0.001
"""Standard uncertainty that a centre of gravity declared without one counts with [m].

Prior: as `[undeclared]` has it.
"""


def exact_quantities(problem: Problem) -> dict[Finding, str]:
    """Return the unknowns that are declared without a standard uncertainty, by the finding that blames them."""
    exact = {}
    if problem.centre is None and problem.mass is not None and not problem.mass_uncertainty:
        exact[Finding.MASS] = "mass"
    if problem.centre is None and not problem.sigma_r_cg.any():
        exact[Finding.CENTRE] = "r_cg"
    return exact


def exact_declaration(cause: Evidence, problem: Problem) -> Declaration:
    """Return the record of the exact quantity that a cause blames."""
    name = exact_quantities(problem)[cause.cause.finding]
    declared = problem.r_cg if name == "r_cg" else np.array([problem.mass])
    sigma = TYPICAL_CENTRE if name == "r_cg" else TYPICAL_MASS * float(declared[0])
    change = cause.cause.size * cause.coefficients
    worst = int(np.argmax(np.abs(change)))
    return declaration(name, worst, declared[worst] + change[worst], declared[worst], sigma, exact=True)


def departing_declarations(
    problem: Problem, fits: Sequence[RunFit], exact_errors: Sequence[Sequence[Evidence]]
) -> tuple[Declaration, ...]:
    """Return the quantities declared with an uncertainty that the runs place elsewhere, by one fit of all of them.

    Args:
        problem: runs, and what is declared.
        fits: of the runs, each at its best under the same prior.
        exact_errors: causes in each run that blame exact quantities: what they explain counts as explained.
    """
    if not fits:
        return ()
    prior = fits[0].prior
    rows = [
        (fit.residuals + fit.columns @ fit.best)[:, :, None]
        - sum(fit.transformed(cause.added[:, :, None]) for cause in causes)
        for fit, causes in zip(fits, exact_errors, strict=True)
    ]
    theta = prior.mean + pooled_change(fits, rows, shared_unknowns(problem))[:, 0]
    names = {"mass", "r_cg", *(error.unknown for error in problem.errors.values() if error.shared)}
    return departures(theta, prior.mean, prior.covariance, names)


def farthest(declarations: Iterable[Declaration]) -> tuple[Declaration, ...]:
    """Return of each quantity the record that is farthest from what was declared, if it is far."""
    ordered = sorted(declarations, key=lambda record: record.distance)
    return tuple({record.quantity: record for record in ordered if record.distance > FAR}.values())
