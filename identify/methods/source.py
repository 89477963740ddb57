"""The source's estimator: r_CG as it is given, ordinary least squares."""

from identify.estimators.run_information import information
from identify.methods.base import Estimator, Problem
from identify.methods.pooled_result import pooled_result
from identify.results.identification_result import Identification


class SourceEstimator(Estimator):
    """Least squares on Omega_R (10), each run weighted by the inverse of its residual variance."""

    type_a = "What the runs show, residuals correlated in time and scatter between runs, is evaluated as type A."

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty."""
        return pooled_result(problem, information, "source")
