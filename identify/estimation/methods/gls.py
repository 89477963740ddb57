"""Generalised least squares: r_CG as stated, rows weighed by their errors' covariance, where weights can be trusted."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from identify.display.rounding import significant
from identify.estimation.joint.priors import axes_of
from identify.estimation.methods.base import Method, Problem
from identify.estimation.methods.source import estimator_for, result_of
from identify.least_squares.generalised_least_squares import Weighed, whitened
from identify.least_squares.hausman import CHANCE, EstimateDifference, differences, reaching
from identify.least_squares.pooling import pool
from identify.results.identification_result import Identification

OTHERS = ("by ordinary least squares", "if moments that follow the motion have unknowns of their own")


class GeneralisedLeastSquares(Method):
    """Least squares on Omega_R, weighed by the errors' covariance across axes and in time."""

    type_a = (
        "What the runs show is evaluated as type A: generalised least squares with the residuals' covariance across "
        "axes and in time, and the scatter between runs."
    )

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty.

        Where other estimates from the same runs differ by more than chance, it is that of ordinary least squares, the
        interval wide enough for all of them; runs too brief for weights are fitted by ordinary least squares.

        Raises:
            RunError: a run too short for the estimator, or a motion that identifies nothing.
        """
        spec, sigma = estimator_for(problem), problem.sigma_r_cg
        errors = list(axes_of(problem.errors).values())
        runs = problem.by_run(
            partial(
                whitened, estimator=spec, r_cg=problem.r_cg, offsets=problem.offsets, sigma_r_cg=sigma, errors=errors
            )
        )
        weighted, plain = ([getattr(run, name) for run in runs] for name in ("weighted", "plain"))
        with_weights, without = pool(weighted, sigma), pool(plain, sigma)
        centre_covariance = np.diag(sigma**2) if problem.centre is None else problem.centre.covariance[1:4, 1:4]
        every = differences(runs, with_weights, without, centre_covariance)
        warnings = _too_brief(runs)
        if not any(difference.chance < CHANCE for difference in every):
            return result_of(problem, spec, weighted, with_weights, "gls", warnings)
        answer = reaching(without, with_weights, every)
        return result_of(problem, spec, plain, answer, "gls", [*warnings, _disagreement(every)])


def _too_brief(runs: Sequence[Weighed]) -> list[str]:
    names = [run.plain.run.name for run in runs if not run.enough]
    if not names:
        return []
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return [
        f"{names[0]}{more}: too short to estimate weights from: ordinary least squares are used, as with method source"
    ]


def _disagreement(every: Sequence[EstimateDifference]) -> str:
    """Return a sentence on the difference that is least probable by chance."""
    k = int(np.argmin([difference.chance for difference in every]))
    component, value, expected = every[k].largest
    return (
        f"the weights cannot be trusted: {OTHERS[k]}, {component} differs by {significant(value, 2)} g·m², where "
        f"{significant(expected, 2)} g·m² is expected; the result is that of ordinary least squares, its interval "
        "wide enough for both. Something follows the motion: usually a wrong r_CG, a cable, cross-talk or a flexible "
        "mounting"
    )
