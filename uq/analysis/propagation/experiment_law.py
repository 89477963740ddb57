"""The law of propagation for an experiment: every source, group and their total, without a single draw.

White noise of the gyro changes the Gram sums by terms linear and quadratic in it, so their mean is not the noise-free
sums. The law is therefore expanded about the EXPECTED sums; the textbook's, about the noise-free run, stands beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from identify.exceptions import explains_names
from identify.floating_point import check_precision
from uq.analysis.propagation.adjustable_law import adjustable
from uq.analysis.propagation.expansion import propagate_case
from uq.analysis.propagation.inputs import CaseInputs, Constants, constants_of, inputs_of_cases
from uq.analysis.propagation.law_result import LawResult, LawStatistics
from uq.analysis.propagation.prepared_run import PreparedRun, prepared_run, stacked
from uq.analysis.propagation.uncovered_sources import check_law
from uq.analysis.propagation.undrawn_errors import undrawn_errors, without_undrawn
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.campaign.statistics import Breakdown, large_mean_error
from uq.monte_carlo.gram_sums.cases import Case, cases_of
from uq.sources.constant_errors import perturbed
from uq.sources.source import Source


@dataclass(frozen=True)
class PreparedLaw:
    """Sums over an experiment's runs: the law for any size of its errors follows in milliseconds."""

    experiment: Experiment
    estimators: tuple[str, ...]
    runs: dict[str, PreparedRun]
    """Sums over the run of each trajectory, by its name."""
    warnings: tuple[str, ...]

    def evaluate(self, sources: Sequence[Source] | None = None) -> LawResult:
        """Return the law for the experiment's sources, or for others of the same kinds in their place.

        Raises:
            ExperimentError: a source that the law cannot take, or one of a kind that was not prepared for.
        """
        experiment = self.experiment if sources is None else replace(self.experiment, sources=tuple(sources))
        cases = cases_of(experiment.sources)
        breakdowns, warnings = {}, list(self.warnings)
        for name, estimators in self.of_cases(cases, experiment.sources).items():
            breakdowns[name] = {e: Breakdown.of(cases, figures) for e, figures in estimators.items()}
            for estimator, breakdown in breakdowns[name].items():
                warnings += large_mean_error(f"{name}, {estimator}", breakdown.total)
        nominal = np.asarray(experiment.body.inertia)
        numbers = partial(adjustable, experiment, self.runs, self.estimators)
        return LawResult(
            nominal=nominal, breakdowns=breakdowns, warnings=tuple(warnings), inputs=experiment.inputs,
            adjustable=numbers,
        )  # fmt: skip

    def of_cases(
        self, cases: Sequence[Case], sources: Sequence[Source]
    ) -> dict[str, dict[str, tuple[LawStatistics, ...]]]:
        """Return the law by trajectory, estimator and case alone, without what :meth:`evaluate` tells beside it.

        Raises:
            ExperimentError: as for :meth:`evaluate`.
        """
        if other := perturbed(sources) - perturbed(self.experiment.sources):
            raise ExperimentError(
                f"errors that the law was not prepared for ({', '.join(sorted(other))}): prepare anew"
            )
        mixing, results = self.experiment.mixing, {}
        for run in self.runs.values():
            check_law(sources, mixing, run.peaks)
        constants = constants_of(sources, mixing)
        random, undrawn = zip(*(without_undrawn(case, sources) for case in cases), strict=True)
        experiment = replace(self.experiment, sources=tuple(sources))
        at_rate: dict[float, CaseInputs] = {}
        for name, run in self.runs.items():
            spec = self.experiment.trajectories[name]
            if spec.rate not in at_rate:
                at_rate[spec.rate] = inputs_of_cases(random, constants, sources, mixing, spec.rate, run.peaks)
            statistics = _of_run(run, constants, at_rate[spec.rate])
            same = undrawn_errors(experiment, spec, self.estimators, run, set(undrawn))
            results[name] = {
                estimator: tuple(
                    LawStatistics(*(leaf[k, c] for leaf in statistics)).shifted(same[undrawn[c]][k])
                    for c in range(len(cases))
                )
                for k, estimator in enumerate(self.estimators)
            }
        return results


@explains_names
def law(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> LawResult:
    """Propagate an experiment's errors by the law of propagation.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all. Those that are asked for together use the samples
            where all of them have a derivative, as in the Monte Carlo.

    Returns:
        Mean error and dispersion of every component for all sources together, each group alone and each source alone.

    Raises:
        ExperimentError: no such trajectory or estimator, nothing to estimate from, or a source beyond the law.
    """
    return prepare_law(experiment, trajectories, estimators).evaluate()


@explains_names
def prepare_law(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> PreparedLaw:
    """Sum over every trajectory once, unless an earlier call has; see :func:`law`."""
    warnings = tuple(check_precision("float64"))
    chosen, specs = experiment.selected_estimators(estimators), experiment.selected_trajectories(trajectories)
    runs = {name: prepared_run(experiment, spec, chosen) for name, spec in specs.items()}
    return PreparedLaw(experiment, tuple(e.name for e in chosen), runs, warnings)


# --- a single run ---


def _of_run(run: PreparedRun, constants: Constants, cases: CaseInputs) -> tuple[np.ndarray, ...]:
    """The fields of :class:`LawStatistics`, estimators and cases leading."""
    expected = cases.acts * constants.mean @ constants.errors.T
    at, free = (
        stacked([run.expansion(e, v, constants.errors) for e, v in zip(expected, variances, strict=True)], axis=1)
        for variances in (cases.gyro, np.zeros_like(cases.gyro))
    )
    noise = stacked([run.scatter(variance) for variance in cases.gyro], axis=1)
    covariance = constants.covariance(cases.acts)
    # about the expected sums, in which the squares of the noise stand exactly
    moments = propagate_case(at, covariance, noise.covariance + run.cell_scatter(noise.mean, cases.wrench))
    linear = noise.linear + run.cell_scatter(noise.noise_free, cases.wrench)
    # about the noise-free run, as a textbook does it: beside the law, to show what that leaves out
    textbook = propagate_case(free, covariance, linear, noise.change)
    uncertainty, degrees = _freedom(constants, at.jacobian, covariance, moments.covariance)
    nominal = run.body.inertia
    errors = [value - nominal for value in (moments.mean, free.value, textbook.mean)]
    return errors[0], moments.covariance, errors[1], errors[2], textbook.first_order, uncertainty, degrees


def _freedom(
    constants: Constants,
    jacobian: Float[np.ndarray, "... 6 d"],
    covariance: Float[np.ndarray, "... d d"],
    total: Float[np.ndarray, "... 6 6"],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the GUM's standard uncertainty and its effective degrees of freedom (Welch and Satterthwaite, G.4)."""
    # J_s Σ_st J_t, number by number, so that those with shared degrees of freedom can be added before they are squared
    terms = jacobian[..., :, None] * covariance[..., None, :, :] * jacobian[..., None, :]
    gum_terms = terms * np.outer(constants.gum_ratio, constants.gum_ratio)
    squares = np.einsum("si,...aij,sj->...as", constants.joint, gum_terms, constants.joint)
    total_variance = np.diagonal(total, axis1=-2, axis2=-1)
    # Student's t enters with its scale (GUM 4.2.3), smaller than its standard deviation
    variance = np.maximum(total_variance - np.sum(terms - gum_terms, axis=(-1, -2)), 0)
    freedom = np.min(np.where(constants.joint > 0, constants.freedom, np.inf), axis=1, initial=np.inf)
    denominator = np.sum(squares**2 / freedom, axis=-1)
    effective = np.divide(variance**2, denominator, out=np.full_like(variance, np.inf), where=denominator > 0)
    return np.sqrt(variance), effective
