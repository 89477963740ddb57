"""The declared systematic sources of a recorded run, propagated by Monte Carlo around the fitted motion (type B).

What the residuals show of noise is type A already (:mod:`identify.estimators.pooling`); precision sources are not
added to it (:mod:`uq.recorded.measured_noise` compares the two). Constant sources leave no residual and are common to
all runs, so they do not average out; those that each mounting draws independently do.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Float, Int, Key

from identify.choices import OffsetChoice
from identify.estimators.gram import normal_equations, solve_normal
from identify.estimators.pooling import Pooling
from identify.judge.judged_result import with_misfit
from identify.methods.base import estimator_of
from identify.pytree import Pytree, static_field
from identify.results.covariances import positive, with_cross
from identify.results.identification_result import MISFIT, Identification, covering_bias
from identify.results.mass_and_centre import POSES
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import Array
from identify.signals.run import Run, RunError
from rig.exceptions import quoted
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.gram_sums.error_maps import Platform, WrenchBasis
from uq.gram_sums.run_sums import RunSums, delay_nodes
from uq.identification.centre_errors import (
    Shared,
    centre_source,
    shared_sources,
    with_shared_errors,
)
from uq.identification.combined_uncertainty import (
    SEED,
    Systematic,
    budget_of,
    combined_diagnostics,
    combined_interval,
    widened_by_sources,
)
from uq.identification.run_sums import measured, run_sums, weighed_equations
from uq.sources.constant_errors import Errors, errors_of_cases, no_errors, over_cases
from uq.sources.draws import Mixing, draw_constants
from uq.sources.source import Source
from uq.trials.trial_loop import all_trials, finite_trials

TRIALS = 10_000
"""Draws of the systematic errors."""
BATCH = 25
"""Trials at a time, which bounds memory."""
REACH = 5.0
"""Standard deviations of a delay that the sums span; a draw beyond, one of two million, counts as the last within."""
HELD = frozenset({"gravity", "r_cg_from_omb", "tilt"})
"""Errors that a recorded wrench holds already: (10) takes the force as measured. Fields of :class:`Errors`."""


class SystematicProblem(Pytree):
    """Everything that a draw of the systematic errors needs: nothing grows with the runs' length."""

    sums: tuple[RunSums, ...]
    """Sums over the runs of each mounting."""
    body: Body
    platform: Platform
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    basis: WrenchBasis
    centre_by_draw: dict[str, Float[Array, "3 n"]]
    """Change of the static poses' centre of gravity by each source's draw, which it already holds [m]."""
    redrawn: frozenset[str] = static_field()
    """Sources that each mounting draws independently."""
    offsets: OffsetChoice = static_field()
    weighed: bool = static_field()
    """Whether the sums are those of generalised least squares."""

    @property
    def cases(self) -> tuple[frozenset[str], ...]:
        """The sources that all mountings share, those that each draws independently (if any), and each one alone."""
        names = frozenset(source.name for source in self.sources)
        alone = (frozenset([source.name]) for source in self.sources)
        return (names - self.redrawn, *([self.redrawn] if self.redrawn else []), *alone)


UNDETERMINED = "declared sources are not in these intervals: the motion does not determine the whole tensor"


def with_declared_sources(
    result: Identification,
    runs: Sequence[Run],
    experiment: Experiment,
    *,
    redrawn: Collection[str] = (),
    trials: int = TRIALS,
) -> Identification:
    """Return a result whose uncertainty holds the experiment's systematic sources, with its budget.

    The covariance is type A (residuals and scatter) plus that of the sources' errors; the interval of 95 % is from
    quantiles of both errors' sum, type A's drawn from Student's t (JCGM 101, 6.4.9). Expected errors of the sources,
    such as of a stated ``mean``, are added to ``bias``, and are in the interval.

    Args:
        result: of these runs.
        runs: the runs, in the result's order.
        experiment: its sources.
        redrawn: names of sources that each mounting draws independently, where the runs name their mountings.
        trials: draws of the errors.

    Raises:
        ExperimentError: ``redrawn`` names no constant source, or not all that are correlated.
        RunError: a declared delay takes more than half of a run, or half of the draws leave no solution.
    """
    if result.seen is not None:
        return replace(result, warnings=(*result.warnings, UNDETERMINED))
    systematic = propagated(problem_of(result, runs, experiment, redrawn=redrawn), trials=trials)
    if systematic.failed:
        left_out = f"{systematic.failed:,} of {trials:,} draws of the declared sources leave no solution"
        if systematic.failed > trials / 2:  # those that remain are no sample of the errors
            raise RunError(f"{left_out}: state smaller errors in [[source]]")
        result = replace(result, warnings=(*result.warnings, f"{left_out}: they are left out"))
    if result.pooling is None:
        return widened_by_sources(result, systematic)
    predicted = np.hypot(systematic.by_mounting.std(axis=0), _centre_by_mounting(result, experiment, redrawn))
    together = replace(result.pooling, from_redrawn_sources=predicted)
    result = _with_predicted_scatter(result, together)
    if result.admissible is not None:
        return widened_by_sources(result, systematic)
    if not systematic.sources:
        misfit = {} if result.misfit is None else {MISFIT: np.linalg.norm(result.misfit, axis=1)}
        return replace(result, budget=budget_of(together, misfit))
    low, high = combined_interval(together, systematic.common)
    source_covariance = np.cov(systematic.common.T, ddof=1)
    if "r_cg" in redrawn and len({run.mounting for run in result.runs}) > 1:  # each mounting has its own
        uncorrelated = scipy.linalg.block_diag(result.parameters.covariance[:4, :4], result.covariance)
        result = replace(result, parameters=replace(result.parameters, covariance=uncorrelated))
    else:
        result = _with_shared_errors(result, runs, experiment, redrawn)
    ten = np.nan_to_num(result.parameters.covariance)
    # draws know a variance to a per cent, and may fall short of what the centre of gravity's part is
    covariance = with_cross(together.covariance + source_covariance, ten[:4, :4], ten[:4, 4:])
    ends = result.inertia[:, None] - np.stack([high, low], axis=1)
    with_sources = replace(
        result.with_tensor_uncertainty(covariance, ends),
        bias=result.bias + systematic.common.mean(axis=0),
        pooling=together,
        budget=budget_of(together, {name: errors.std(axis=0) for name, errors in systematic.alone.items()}),
        diagnostics={
            **result.diagnostics,
            **combined_diagnostics(together, covariance, source_covariance, (low, high)),
            "declared_sources": {"trials": trials, "seed": SEED},
        },
    )
    with_bias = covering_bias(with_sources, result.bias)
    return with_bias if result.misfit is None else with_misfit(with_bias, result.misfit)


def _centre_by_mounting(result: Identification, experiment: Experiment, redrawn: Collection[str]) -> np.ndarray:
    """Part of u by r_CG, which each mounting draws, where it is in the result and not drawn."""
    assert result.pooling is not None  # noqa: S101
    names = {source.name for source in experiment.sources if source.perturbs == "r_cg"}
    if result.admissible is None or result.pooling.mountings < 2 or not names & set(redrawn):
        return np.zeros(6)
    return np.asarray(result.diagnostics["standard_uncertainty_from_cg"]) / np.sqrt(result.pooling.mountings)


def _with_predicted_scatter(result: Identification, together: Pooling) -> Identification:
    """A result whose warnings of scatter know what each mounting draws, which predicts more of it."""
    warned = result.pooling.warnings if result.pooling else ()
    others = tuple(text for text in result.warnings if text not in warned)
    warnings = others if len(others) == len(result.warnings) else (*others, *together.warnings)
    return replace(result, warnings=warnings, pooling=together)


def propagated(problem: SystematicProblem, *, trials: int = TRIALS) -> Systematic:
    """Return the errors that draws of a problem's constant sources make of its pooled tensor."""
    if not problem.sources:
        zero = np.zeros((trials, 6))
        return Systematic((), zero, zero, {})
    tensors = all_trials(_trials, problem, trials, SEED, batch=BATCH, segment=trials)
    errors, failed = finite_trials(tensors - np.linalg.solve(*equations(problem, [no_errors()] * len(problem.sums))))
    common, *others = np.moveaxis(errors, 1, 0)
    by_mounting = others.pop(0) if problem.redrawn else np.zeros_like(common)
    alone = {source.name: source_errors for source, source_errors in zip(problem.sources, others, strict=True)}
    return Systematic(sources=problem.sources, common=common, by_mounting=by_mounting, alone=alone, failed=failed)


def problem_of(
    result: Identification, runs: Sequence[Run], experiment: Experiment,
    *, redrawn: Collection[str] = (), slopes: bool = False,
) -> SystematicProblem:  # fmt: skip
    """Return what the draws need of a result and its runs; with ``slopes``, what its derivatives at no error need.

    Raises:
        ExperimentError, RunError: see :func:`with_declared_sources`.
    """
    sources, mixing = acting(result, experiment, redrawn)
    names = [fitted.mounting for fitted in result.runs]  # None where the runs' names are not believed
    mountings = dict.fromkeys(names)
    _check_redrawn(redrawn, experiment.sources, mixing)
    nodes = nodes_of(sources, slopes=slopes)
    basis = WrenchBasis.of(sources)
    fit = result.estimator, result.r_cg, result.inertia, basis
    sums = [
        run_sums(run, *fit, offsets=result.offsets, weight=fitted.weight, delays=nodes, weighed=fitted.weighed)
        for run, fitted in zip(runs, result.runs, strict=True)
    ]
    by_mounting = tuple(
        RunSums.total([part for part, name in zip(sums, names, strict=True) if name == mounting])
        for mounting in mountings
    )
    body = Body(np.asarray(result.mass or 0.0), result.r_cg, result.inertia)
    platform = Platform(np.array(experiment.gravity), np.zeros(3))
    acting_redrawn = frozenset(redrawn) & {source.name for source in sources} if len(mountings) > 1 else frozenset()
    return SystematicProblem(
        sums=by_mounting, body=body, platform=platform, sources=sources, mixing=mixing, basis=basis,
        centre_by_draw={name: shared.by_draw for name, shared in _shared(result, sources, mixing, redrawn).items()},
        redrawn=acting_redrawn, offsets=result.offsets,
        weighed=any(fitted.weighed is not None for fitted in result.runs),
    )  # fmt: skip


def _shared(
    result: Identification, sources: Sequence[Source], mixing: Sequence[Mixing], redrawn: Collection[str]
) -> dict[str, Shared]:
    return shared_sources(result, [source for source in sources if source.name not in redrawn], mixing)


def acting(
    result: Identification, experiment: Experiment, redrawn: Collection[str] = ()
) -> tuple[tuple[Source, ...], tuple[Mixing, ...]]:
    """Return the constant sources that a result does not hold yet, and which of them are correlated.

    The centre of gravity's uncertainty is the result's, wherever it comes from: ``[[source]]`` or static poses.
    """
    elsewhere = HELD | estimator_of(result.method).estimates
    sources = [source for source in experiment.sources if source.constant and source.perturbs not in elsewhere]
    mixing = list(experiment.mixing)
    shared = _shared(result, sources, mixing, redrawn)
    from_poses = result.centre_from == POSES
    covariance = result.parameters.covariance[1:4, 1:4] if from_poses else None
    if shared:  # without what shared sources do to it
        held_already = sum(source.on_centre[1:] @ source.on_centre[1:].T for source in shared.values())
        covariance = positive(result.parameters.covariance[1:4, 1:4] - held_already)
    same = np.allclose(result.sigma_r_cg, experiment.sigma_r_cg, rtol=1e-9, atol=0)
    held = result.pooling is None or result.admissible is not None  # the result holds the centre's uncertainty already
    if held or covariance is not None or not same:
        sources = [s for s in sources if s.perturbs != "r_cg"]
        if np.any(result.sigma_r_cg > 0) and not held:
            sigma = result.sigma_r_cg if covariance is None else np.sqrt(np.diag(covariance))
            source, mix = centre_source(sigma, covariance)
            sources, mixing = [*sources, source], [*mixing, *mix]
    names = {source.name for source in sources}
    return tuple(sources), tuple(mix for mix in mixing if names & set(mix.names))


def _check_redrawn(redrawn: Collection[str], sources: Sequence[Source], mixing: Sequence[Mixing]) -> None:
    constant = [source.name for source in sources if source.constant]
    for name in redrawn:
        if name not in constant:
            raise ExperimentError(
                f"recording.drawn_by_mounting names {quoted(name)}: name sources that are drawn once "
                f"({', '.join(constant) or 'there are none'})"
            )
    for mix in mixing:
        inside = set(mix.names) & set(redrawn)
        if inside and not set(mix.names) <= set(redrawn):
            raise ExperimentError(
                f"recording.drawn_by_mounting names '{min(inside)}' without what it is correlated with: name all of "
                f"{', '.join(mix.names)}"
            )


def nodes_of(sources: Sequence[Source], *, slopes: bool = False) -> np.ndarray:
    """Return the delays [s] at which the sums are taken for these sources; for derivatives at none, three."""
    delays = [source for source in sources if source.perturbs == "gyro_delay"]
    mean = float(sum(np.sum(source.mean) for source in delays))
    sigma = float(np.sqrt(sum(np.sum(np.square(source.standard_deviation)) for source in delays)))
    if slopes:
        return delay_nodes(-sigma, sigma, 3)
    return delay_nodes(min(0.0, mean - REACH * sigma), max(0.0, mean + REACH * sigma))


def draws(problem: SystematicProblem, key: Key[Array, ""], index: Any) -> list[dict[str, jax.Array]]:
    """Return the errors that one trial draws, for each mounting; the first one's are what all others share."""
    draw = lambda key: draw_constants(problem.sources, problem.mixing, key, index, float)  # noqa: E731
    first, count = draw(key), len(problem.sums)
    if not problem.redrawn:
        return [first] * count
    others = [draw(jax.random.fold_in(key, number)) for number in range(1, count)]
    return [first, *(first | {name: drawn[name] for name in problem.redrawn} for drawn in others)]


def estimate(problem: SystematicProblem, errors: Sequence[Errors]) -> Float[Array, "6"]:
    """Return the pooled tensor that the estimator gives with these errors, one set a mounting: smooth in them."""
    return solve_normal(*equations(problem, errors)).inertia


def equations(problem: SystematicProblem, errors: Sequence[Errors]) -> tuple[Float[Array, "6 6"], Float[Array, "6"]]:
    """Return the pooled normal equations with these errors, in JAX or, where all is of NumPy, in NumPy."""
    normal, right = np.zeros((6, 6)), np.zeros(6)
    for sums, error in zip(problem.sums, errors, strict=True):
        if problem.offsets == "still":
            error = error._replace(cell_bias=np.zeros(6))
        wrench_map = problem.basis.map(problem.body, problem.platform, error)
        r_cg = problem.body.r_cg_from_q + error.r_cg
        if problem.weighed:
            matrix, side = weighed_equations(sums, error, wrench_map, r_cg)
        else:
            matrix, side = normal_equations(measured(sums, error, wrench_map), r_cg)
        normal, right = normal + matrix, right + side
    return normal, right


def errors_of(problem: SystematicProblem, drawn: Mapping[str, Array], cases: Sequence[frozenset[str]]) -> Errors:
    """Return the errors that act in each case, with those of the centre of gravity that a source has made before."""
    errors = errors_of_cases(problem.sources, drawn, cases)
    for name, by_draw in problem.centre_by_draw.items():
        acts = np.array([[float(name in case)] for case in cases])
        errors = errors._replace(r_cg=errors.r_cg + acts * (by_draw @ drawn[name].ravel())[None])
    return errors


@partial(jax.jit, static_argnames="name")
def _of_axes(problem: SystematicProblem, name: str, axes: Float[Array, "k n"]) -> Float[Array, "k 6"]:
    """The tensor with each of some draws of one source."""
    nothing = {source.name: jnp.zeros(np.shape(source.sigma)) for source in problem.sources}

    def tensor(axis):
        drawn = nothing | {name: axis.reshape(nothing[name].shape)}
        alone = Errors(*(leaf[0] for leaf in errors_of(problem, drawn, (frozenset([name]),))))
        return estimate(problem, [alone] * len(problem.sums))

    return jax.vmap(tensor)(axes)


def _with_shared_errors(
    result: Identification, runs: Sequence[Run], experiment: Experiment, redrawn: Collection[str]
) -> Identification:
    """The result, correlated with mass and centre of gravity by the errors that have made both of them wrong."""
    if not _shared(result, experiment.sources, experiment.mixing, redrawn):
        return result
    problem = problem_of(result, runs, experiment, redrawn=redrawn)
    shared = _shared(result, problem.sources, problem.mixing, redrawn)
    changes = {}
    for name, source in shared.items():
        axes = jnp.asarray(source.root.T)
        changes[name] = np.asarray(_of_axes(problem, name, axes) - _of_axes(problem, name, -axes)) / 2  # GUM 5.1.3
    return with_shared_errors(result, shared, changes)


def _trials(
    problem: SystematicProblem, key: Key[Array, ""], indices: Int[Array, " trials"]
) -> Float[Array, "trials cases 6"]:
    def of_trial(index):
        errors = [errors_of(problem, drawn, problem.cases) for drawn in draws(problem, key, index)]
        return over_cases(lambda *case_errors: estimate(problem, case_errors), errors)

    return jax.vmap(of_trial)(indices)
