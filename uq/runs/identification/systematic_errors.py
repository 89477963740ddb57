"""The declared systematic sources of a recorded run, propagated by Monte Carlo around the fitted motion (type B).

What the residuals show of noise is type A already (:mod:`identify.least_squares.pooling`); precision sources are not
added to it (:mod:`uq.runs.recorded.measured_noise` compares the two). Constant sources leave no residual and are common
to all runs, so they do not average out; those that each mounting draws independently do.
"""

from collections.abc import Collection, ItemsView, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int, Key

from identify.choices import OffsetChoice
from identify.estimation.methods.base import estimator_of
from identify.least_squares.gram import normal_equations, solve_normal
from identify.least_squares.pooling import Pooling
from identify.pytree import Pytree, static_field
from identify.results.identification_result import CG, Identification
from identify.results.ledger import SEED, Ledger, Row, drawn_row, tensor_row, type_a_rows
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import Array
from identify.signals.run import Run, RunError
from rig.exceptions import quoted
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis
from uq.monte_carlo.gram_sums.run_sums import RunSums, delay_nodes
from uq.monte_carlo.trials.trial_loop import all_trials, finite_trials
from uq.runs.identification.estimated_errors import correlated_set, draw_root
from uq.runs.identification.recorded_sums import measured, run_sums, weighed_equations
from uq.sources.constant_errors import Errors, errors_of, errors_of_cases, no_errors, over_cases
from uq.sources.draws import Mixing, draw_constants
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Source

TRIALS = 10_000
"""Draws of the systematic errors."""
BATCH = 25
"""Trials at a time, which bounds memory."""
REACH = 5.0
"""Standard deviations of a delay that the sums span; a draw beyond, one of two million, counts as the last within."""
IN_THE_WRENCH = frozenset({"gravity", "r_cg_from_omb", "tilt"})
"""Errors that a recorded wrench holds already: (10) takes the force as measured. Fields of :class:`Errors`."""
SAME_FOR_EVERY_BODY = frozenset(
    {"cell_scale", "cell_cross_talk", "cell_misalignment", "gyro_scale", "gyro_misalignment", "gyro_delay"}
)
"""Errors that are the same in another body's runs. Fields of :class:`Errors`."""


class Systematic(NamedTuple):
    """Errors of a pooled tensor from the systematic sources."""

    by_mounting: Float[np.ndarray, "trials 6"]
    """Errors of the tensor from the sources that each mounting draws independently [kg·m²]."""
    alone: Mapping[str, Float[np.ndarray, "trials 6"]]
    """Errors of the tensor from each source alone, by its name [kg·m²]."""
    failed: int = 0
    """Draws with which the tensor could not be solved; they are left out."""


class SystematicProblem(Pytree):
    """Everything that a draw of the systematic errors needs: nothing grows with the runs' length."""

    sums: tuple[RunSums, ...]
    """Sums over the runs of each mounting."""
    body: Body
    platform: Platform
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    basis: WrenchBasis
    sources_of_poses: tuple[Source, ...]
    """Sources that act on the sums and have acted on the static poses, too; they are not drawn."""
    redrawn: frozenset[str] = static_field()
    """Sources that each mounting draws independently."""
    offsets: OffsetChoice = static_field()
    weighed: bool = static_field()
    """Whether the sums are those of generalised least squares."""

    sets: tuple[tuple[str, str], ...] = static_field(default=())
    """Name of the set of correlated sources of each source, or its own."""

    def by_set(self, sources: Iterable[Source]) -> ItemsView[str, list[Source]]:
        """Return some of the sources, correlated ones together, by the name of their set."""
        sets, members = dict(self.sets), dict[str, list[Source]]()
        for source in sources:
            members.setdefault(sets.get(source.name, source.name), []).append(source)
        return members.items()

    @property
    def cases(self) -> tuple[frozenset[str], ...]:
        """The sources that each mounting draws independently (if any), and each source alone."""
        alone = (frozenset([source.name]) for source in self.sources)
        return (*([self.redrawn] if self.redrawn else []), *alone)


UNDETERMINED = "declared sources are not in these intervals: the motion does not determine the whole tensor"


def with_declared_sources(
    result: Identification,
    runs: Sequence[Run],
    experiment: Experiment,
    *,
    redrawn: Collection[str] = (),
    trials: int = TRIALS,
) -> Identification:
    """Return a result whose ledger holds the experiment's systematic sources.

    The interval of 95 % is from quantiles of their errors and those of type A (JCGM 101, 6.4.9). Expected errors of the
    sources, such as of a stated ``mean``, are part of ``bias``, and in the interval.

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
        return result.joined(warnings=(*result.warnings, UNDETERMINED))
    problem = problem_of(result, runs, experiment, redrawn=redrawn)
    systematic = propagated(problem, trials=trials)
    warnings = result.warnings
    if systematic.failed:
        left_out = f"{systematic.failed:,} of {trials:,} draws of the declared sources leave no solution"
        if systematic.failed > trials / 2:  # those that remain are no sample of the errors
            raise RunError(f"{left_out}: state smaller errors in [[source]]")
        warnings = (*warnings, f"{left_out}: they are left out")
    rows = [*_by_act(result, experiment), *_drawn_rows(problem, systematic)]
    result, rows = _corrected(result, rows, {calibration.group for calibration in experiment.calibrations})
    if result.pooling is None:
        return result.joined(rows, warnings=warnings)
    by_mounting = systematic.by_mounting.std(axis=0)
    predicted = np.hypot(by_mounting, _centre_by_mounting(result, experiment, redrawn))
    pooling = replace(result.pooling, from_redrawn_sources=predicted)
    warnings = _knowing_predicted_scatter(warnings, result.pooling, pooling)
    if result.admissible is not None:
        return result.joined(rows, warnings=warnings, pooling=pooling)
    measured = type_a_rows(pooling)
    freedom = np.concatenate([np.full(4, np.inf), pooling.effective_degrees_of_freedom])
    rows += [
        tensor_row(name, np.diag(systematic.alone[name].std(axis=0)), degrees_of_freedom=freedom)
        for name in problem.redrawn
    ]
    others = [row for row in result.ledger.rows if row.tier != "measured"]
    if any(source.perturbs == "r_cg" for source in problem.sources):  # each mounting has its own
        others = [row.changed(OF_MASS_AND_CENTRE) if row.error == CG else row for row in others]
    rows += _of_poses(result, problem, experiment.mixing)
    ledger = Ledger((*measured, *others), result.ledger.expected).joined(rows)
    return replace(
        result, ledger=ledger, warnings=warnings, pooling=pooling,
        diagnostics={**result.diagnostics, **_diagnostics(ledger, pooling, trials)},
    )  # fmt: skip


def _drawn_rows(problem: SystematicProblem, systematic: Systematic) -> Iterator[Row]:
    """Rows of the drawn sources, one a source or a set of correlated ones, whose errors add trial by trial."""
    for name, members in problem.by_set(source for source in problem.sources if source.name not in problem.redrawn):
        errors = np.sum([systematic.alone[source.name] for source in members], axis=0)
        same = all(source.perturbs in SAME_FOR_EVERY_BODY for source in members)
        yield drawn_row(name, errors, key=name if same else "")


def _corrected(result: Identification, rows: Sequence[Row], names: Collection[str]) -> tuple[Identification, list[Row]]:
    """The result corrected by the expected errors of calibrated sources (GUM 3.2.4), and the rows without these."""
    shift = np.sum([np.broadcast_to(row.mean, 10) for row in rows if row.error in names], axis=0)
    rows = [replace(row, mean=0.0) if row.error in names else row for row in rows]
    return replace(result, value=result.value - shift), rows


def _by_act(result: Identification, experiment: Experiment) -> Iterator[Row]:
    """Rows of errors that are declared by their file alone, by the estimate's derivatives; `joint` has its unknowns."""
    derivatives = result.by_held_errors or {}
    for source in experiment.sources:
        kind = source.error_kind
        estimated = isinstance(kind, ErrorByAct) and result.method == "joint" and kind.error.unknowns
        if isinstance(kind, ErrorByAct) and not estimated and kind.error.name in derivatives:
            changes = derivatives[kind.error.name] @ draw_root(source, experiment.mixing)
            yield Row(error=source.name, changes=changes, key=source.name)


OF_MASS_AND_CENTRE = (np.arange(10) < 4)[:, None].astype(float)
"""Factors that leave a row's changes of mass and centre of gravity alone."""


def _of_poses(result: Identification, problem: SystematicProblem, mixing: Sequence[Mixing]) -> list[Row]:
    """Rows of errors that have made the static poses' mass and centre of gravity wrong and act in the runs, too.

    Their effect on the tensor by both ways, by central differences (GUM 5.1.3), takes the place of that by the centre.
    """
    before = {row.key: row for row in result.ledger.rows if row.key}
    rows = []
    for name, members in problem.by_set(problem.sources_of_poses):
        row = before[name]
        draws = zip(*(draw_root(source, mixing).T for source in members), strict=True)
        changes = [
            (_estimate_with(problem, members, axes, centre) - _estimate_with(problem, members, axes, centre, -1.0)) / 2
            for axes, centre in zip(draws, row.changes[1:4].T, strict=True)
        ]
        rows.append(replace(row, changes=np.vstack([row.changes[:4], np.transpose(changes)])))
    return rows


def _centre_by_mounting(result: Identification, experiment: Experiment, redrawn: Collection[str]) -> np.ndarray:
    """Part of u by r_CG, which each mounting draws, where it is in the result and not drawn."""
    assert result.pooling is not None  # noqa: S101
    names = {source.name for source in experiment.sources if source.perturbs == "r_cg"}
    if result.admissible is None or result.pooling.mountings < 2 or not names & set(redrawn):
        return np.zeros(6)
    return np.asarray(result.diagnostics["standard_uncertainty_from_cg"]) / np.sqrt(result.pooling.mountings)


def _knowing_predicted_scatter(warnings: tuple[str, ...], pooling: Pooling, together: Pooling) -> tuple[str, ...]:
    """Warnings, of which those of scatter know what each mounting draws, which predicts more of it."""
    others = tuple(text for text in warnings if text not in pooling.warnings)
    return warnings if len(others) == len(warnings) else (*others, *together.warnings)


def _diagnostics(ledger: Ledger, pooling: Pooling, trials: int) -> dict[str, Any]:
    """Standard uncertainties of type A and B, degrees of freedom and coverage factor of the tensor."""
    rows, u = ledger.in_intervals, ledger.in_intervals.standard_uncertainty
    return {
        "standard_uncertainty_type_a": rows.of_tiers("measured").standard_uncertainty[4:].tolist(),
        "standard_uncertainty_type_b": rows.of_tiers("declared").standard_uncertainty[4:].tolist(),
        "effective_degrees_of_freedom": rows.degrees_of_freedom[4:].tolist(),
        "coverage_factor": (rows.arms().mean(axis=1) / np.maximum(u, 1e-300))[4:].tolist(),
        "scatter_between_runs": pooling.excess.tolist(),
        "declared_sources": {"trials": trials, "seed": SEED},
    }


def propagated(problem: SystematicProblem, *, trials: int = TRIALS) -> Systematic:
    """Return the errors that draws of a problem's constant sources make of its pooled tensor."""
    if not problem.sources:
        return Systematic(np.zeros((trials, 6)), {})
    tensors = all_trials(_trials, problem, trials, SEED, batch=BATCH, segment=trials)
    errors, failed = finite_trials(tensors - np.linalg.solve(*equations(problem, [no_errors()] * len(problem.sums))))
    alone = list(np.moveaxis(errors, 1, 0))
    by_mounting = alone.pop(0) if problem.redrawn else np.zeros((len(errors), 6))
    names = [source.name for source in problem.sources]
    return Systematic(by_mounting, dict(zip(names, alone, strict=True)), failed)


def problem_of(
    result: Identification, runs: Sequence[Run], experiment: Experiment,
    *, redrawn: Collection[str] = (), slopes: bool = False,
) -> SystematicProblem:  # fmt: skip
    """Return what the draws need of a result and its runs; with ``slopes``, what its derivatives at no error need.

    Raises:
        ExperimentError, RunError: see :func:`with_declared_sources`.
    """
    acting = _acting(result, experiment, redrawn, slopes=slopes)
    keys = set() if slopes else {row.key for row in result.ledger.rows} - set(redrawn)
    sets = {source.name: correlated_set(source, experiment) or source.name for source in acting}
    sources, of_poses = (
        tuple(source for source in acting if (sets[source.name] in keys) == had_acted) for had_acted in (False, True)
    )
    drawn = {source.name for source in sources}
    mixing = tuple(mix for mix in experiment.mixing if set(mix.names) & drawn)
    names = [fitted.mounting for fitted in result.runs]  # None where the runs' names are not believed
    mountings = dict.fromkeys(names)
    _check_redrawn(redrawn, experiment.sources, mixing)
    nodes = nodes_of(acting, slopes=slopes)
    basis = WrenchBasis.for_sources(acting)
    fit = result.estimator, result.r_cg, result.inertia, basis
    sums = [
        run_sums(run, *fit, offsets=result.offsets, weight=fitted.weight, delays=nodes, weighed=fitted.weighed)
        for run, fitted in zip(runs if acting else (), result.runs, strict=bool(acting))
    ]
    by_mounting = tuple(
        RunSums.total([part for part, name in zip(sums, names, strict=True) if name == mounting])
        for mounting in mountings if sums
    )  # fmt: skip
    body = Body(np.asarray(result.mass or 0.0), result.r_cg, result.inertia)
    platform = Platform(np.array(experiment.gravity), np.zeros(3))
    acting_redrawn = frozenset(redrawn) & {source.name for source in sources} if len(mountings) > 1 else frozenset()
    return SystematicProblem(
        sums=by_mounting, body=body, platform=platform, sources=sources, mixing=mixing, basis=basis,
        sources_of_poses=of_poses, sets=tuple(sets.items()),
        redrawn=acting_redrawn, offsets=result.offsets,
        weighed=any(fitted.weighed is not None for fitted in result.runs),
    )  # fmt: skip


def _acting(
    result: Identification, experiment: Experiment, redrawn: Collection[str], *, slopes: bool
) -> tuple[Source, ...]:
    """Constant sources that a result does not hold yet.

    It holds the centre of gravity's uncertainty, wherever it comes from, but for what each mounting draws of it.
    """
    elsewhere = IN_THE_WRENCH | estimator_of(result.method).estimates
    drawn_centre = len({run.mounting for run in result.runs}) > 1 and result.pooling and result.admissible is None
    centres = {source.name for source in experiment.sources if slopes or (drawn_centre and source.name in redrawn)}
    return tuple(
        source for source in experiment.sources
        if source.constant and source.perturbs is not None and source.perturbs not in elsewhere
        and (source.perturbs != "r_cg" or source.name in centres)
    )  # fmt: skip


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


def _estimate_with(
    problem: SystematicProblem,
    sources: Sequence[Source],
    draws: Sequence[Float[np.ndarray, " n"]],
    centre: Float[np.ndarray, "3"],
    sign: float = 1.0,
) -> Float[np.ndarray, "6"]:
    """The tensor with draws of some sources, whose action on the static poses has moved the centre of gravity."""
    shaped = {
        source.name: sign * draw.reshape(np.shape(source.sigma)) for source, draw in zip(sources, draws, strict=True)
    }
    errors = errors_of(sources, shaped)
    errors = errors._replace(r_cg=errors.r_cg + sign * centre)
    return np.linalg.solve(*equations(problem, [errors] * len(problem.sums)))


def _trials(
    problem: SystematicProblem, key: Key[Array, ""], indices: Int[Array, " trials"]
) -> Float[Array, "trials cases 6"]:
    def of_trial(index):
        errors = [errors_of_cases(problem.sources, drawn, problem.cases) for drawn in draws(problem, key, index)]
        return over_cases(lambda *case_errors: estimate(problem, case_errors), errors)

    return jax.vmap(of_trial)(indices)
