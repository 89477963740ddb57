"""Generalised least squares: r_CG as stated, rows weighed by their residuals' covariance."""

from identify.estimators.generalised_least_squares import whitened
from identify.methods.base import Estimator, Problem
from identify.methods.source import pooled_result
from identify.results.identification_result import Identification


class GeneralisedLeastSquares(Estimator):
    """Least squares on Omega_R, weighed by the residuals' covariance across axes and in time."""

    type_a = (
        "What the runs show is evaluated as type A: generalised least squares with the residuals' covariance across "
        "axes and in time, and the scatter between runs."
    )

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty."""
        return pooled_result(problem, whitened, "gls")
