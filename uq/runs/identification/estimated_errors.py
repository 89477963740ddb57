"""Declared constant errors as priors of an estimator that estimates them along with the tensor."""

from collections.abc import Callable, Collection
from functools import cache

import numpy as np
from jaxtyping import Float

from identify.errors.body.centre_of_gravity import CENTRE_OF_GRAVITY
from identify.errors.error_model import CELL_MATRIX, ErrorModel
from identify.errors.load_cell.drift import DRIFT
from identify.errors.registry import ERRORS
from identify.estimation.joint.priors import ConstantError
from identify.least_squares.covariance_matrices import root_of
from uq.experiment.experiment import Experiment
from uq.sources.constant_errors import CELL_CHANNELS, effect, no_errors
from uq.sources.draws import Mixing
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Source, kind_of


@cache
def _declared_errors() -> dict[str, ErrorModel]:
    """The error that each field of :class:`uq.sources.constant_errors.Errors` has the numbers of."""
    fields, zero = {}, no_errors()._asdict()
    for error in ERRORS.values():
        if error.declared_as is not None:
            target, name = error.declared_as
            field = kind_of(target, name).perturbs.get(target, "")
            if field and error.count == zero[field].size:
                fields[field] = error
    return fields


def declared_error(source: Source) -> ErrorModel | None:
    """Return the error of the rig that a source declares; None: none of those that runs are judged by."""
    kind = source.error_kind
    return kind.error if isinstance(kind, ErrorByAct) else _declared_errors().get(source.perturbs or "")


def estimated_as(source: Source, duration: float) -> tuple[str, Callable[[np.ndarray], np.ndarray]] | None:
    """Return the unknown of the joint model that a source changes, and the function from what it adds to the numbers.

    None: the source changes none of them, or the centre of gravity, which is not declared as an error.

    Args:
        source: a constant error.
        duration: of a run [s], which makes a change of a drift's slope.
    """
    error = declared_error(source)
    if isinstance(source.error_kind, ErrorByAct):
        return (error.unknowns[0], np.ravel) if error is not None and error.unknowns else None
    if error is None or error is CENTRE_OF_GRAVITY:
        return None
    if error is DRIFT:  # of force or of moment
        first = CELL_CHANNELS[source.target]
        return error.unknowns[first > 0], lambda slope: duration * slope[first : first + 3]
    if error.unknowns == CELL_MATRIX:
        return error.unknowns[0], lambda numbers: error.by_cell_matrix @ np.ravel(numbers)
    return error.unknowns[0], np.atleast_1d


def estimated_errors(
    experiment: Experiment, duration: float, redrawn: Collection[str] = ()
) -> dict[str, ConstantError]:
    """Return the prior of each declared constant error, by the name of its source.

    A source's draws are linear in the unknowns; they count as normal with the same mean and covariance, correlated as
    declared.

    Args:
        experiment: its sources.
        duration: of a run [s], which makes a change of a drift's slope.
        redrawn: names of sources that each mounting draws independently: then each run has its own.
    """
    priors = {}
    for source in experiment.sources:
        if not source.constant:
            continue
        if (estimate := estimated_as(source, duration)) is not None:
            unknown, numbers = estimate
            shape = np.shape(source.sigma)
            basis = np.eye(int(np.prod(shape))).reshape(-1, *shape)
            by_draw = np.stack([numbers(np.asarray(effect(source, unit))) for unit in basis], axis=1)
            axes = by_draw @ draw_root(source, experiment.mixing)
            priors[source.name] = ConstantError(
                unknown=unknown, mean=numbers(np.asarray(effect(source, np.broadcast_to(source.mean, shape)))),
                covariance=axes @ axes.T, shared=source.name not in redrawn, root=axes,
                correlated_as=correlated_set(source, experiment) if source.name not in redrawn else "",
            )  # fmt: skip
    return priors


def drawn_unknowns(experiment: Experiment) -> frozenset[str]:
    """Return the unknowns of the joint model that each mounting draws: all sources that change them are listed so."""
    redrawn, recording = experiment.recording.drawn_by_mounting, experiment.recording
    names: dict[str, set[str]] = {}
    for source in experiment.sources:
        if source.constant:
            unknown, _ = estimated_as(source, 1.0) or ("", None)
            names.setdefault("r_cg" if source.perturbs == "r_cg" else unknown, set()).add(source.name)
    stated = {"delay": recording.sigma_delay, "rotation": recording.sigma_rotation}
    return frozenset(
        unknown for unknown, sources in names.items() if sources <= set(redrawn) and stated.get(unknown) is None
    ) - {""}


def draw_root(source: Source, mixing: Collection[Mixing]) -> Float[np.ndarray, "n k"]:
    """Return a root of the covariance of one source's draw, as declared.

    Sources that are correlated with each other have the same columns: those of a root of their correlation matrix.
    """
    sigma = np.broadcast_to(np.asarray(source.standard_deviation, float), np.shape(source.sigma)).ravel()
    for mix in mixing:
        if source.name in mix.names:
            here, correlation = mix.places[source.name], np.asarray(mix.correlation)
            if len(mix.names) > 1:
                return np.asarray(sigma[:, None] * root_of(correlation)[here])
            return root_of(correlation * np.outer(sigma, sigma))
    return np.diag(sigma)


def correlated_set(source: Source, experiment: Experiment) -> str:
    """Return the name of the set of correlated sources that a source is in, of their group or of all; '': of none."""
    for mix in experiment.mixing:
        if source.name in mix.names and len(mix.names) > 1:
            groups = {other.group for other in experiment.sources if other.name in mix.names}
            return groups.pop() if len(groups) == 1 else ", ".join(mix.names)
    return ""
