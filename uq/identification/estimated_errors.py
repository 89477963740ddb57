"""Declared constant errors as priors of an estimator that estimates them along with the tensor."""

from collections.abc import Callable, Collection, Mapping

import numpy as np

from identify.estimators.covariance_matrices import root_of
from identify.joint.priors import ConstantError
from identify.rigid_body.regressor import cross_matrix
from uq.experiment.experiment import Experiment
from uq.sources.constant_errors import CELL_CHANNELS, effect
from uq.sources.draws import Mixing
from uq.sources.source import Source


def _misaligned(rotation: np.ndarray) -> np.ndarray:
    """``D`` of a load cell that is turned by a small rotation vector against the body's axes."""
    return -np.kron(np.eye(2), np.asarray(cross_matrix(rotation))).ravel()


UNKNOWN: Mapping[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "gravity": ("gravity", np.atleast_1d),
    "r_cg_from_omb": ("cg_from_still", np.asarray),
    "gyro_scale": ("gyro_scale", np.asarray),
    "gyro_delay": ("delay", np.atleast_1d),
    "gyro_misalignment": ("rotation", np.asarray),
    "gyro_drift": ("gyro_drift", np.asarray),
    "cell_scale": ("cell_matrix", lambda scale: np.diag(scale).ravel()),
    "cell_cross_talk": ("cell_matrix", np.ravel),
    "cell_misalignment": ("cell_matrix", _misaligned),
}
"""Unknown of the joint model, and the function to its numbers, by field of
:class:`uq.sources.constant_errors.Errors`."""


def _drift(source: Source, duration: float) -> tuple[str, Callable[[np.ndarray], np.ndarray]]:
    first = CELL_CHANNELS[source.target]
    return ("moment_drift" if first else "force_drift"), lambda slope: duration * slope[first : first + 3]


def estimated_errors(
    experiment: Experiment, duration: float, redrawn: Collection[str] = ()
) -> dict[str, ConstantError]:
    """Return the prior of each declared constant error, by the name of its source.

    A source's draws are linear in the unknowns; they count as normal with the same mean and covariance. Correlations
    between sources are left out: each axis of one source is correlated as declared.

    Args:
        experiment: its sources.
        duration: of a run [s], which makes a change of a drift's slope.
        redrawn: names of sources that each mounting draws independently: then each run has its own.
    """
    priors = {}
    for source in experiment.sources:
        if not source.constant or source.perturbs is None:
            continue
        if source.perturbs in UNKNOWN or source.perturbs == "cell_drift":
            unknown, numbers = UNKNOWN.get(source.perturbs) or _drift(source, duration)
            shape = np.shape(source.sigma)
            basis = np.eye(int(np.prod(shape))).reshape(-1, *shape)
            by_draw = np.stack([numbers(np.asarray(effect(source, unit))) for unit in basis], axis=1)
            axes = by_draw @ draw_root(source, experiment.mixing)
            priors[source.name] = ConstantError(
                unknown=unknown, mean=numbers(np.asarray(effect(source, np.broadcast_to(source.mean, shape)))),
                covariance=axes @ axes.T, shared=source.name not in redrawn, root=axes,
            )  # fmt: skip
    return priors


def drawn_unknowns(experiment: Experiment) -> frozenset[str]:
    """Return the unknowns of the joint model that each mounting draws: all sources that change them are listed so."""
    redrawn, recording = experiment.recording.drawn_by_mounting, experiment.recording
    names: dict[str, set[str]] = {}
    for source in experiment.sources:
        if source.constant and source.perturbs is not None:
            unknown = (
                _drift(source, 1.0)[0] if source.perturbs == "cell_drift" else UNKNOWN.get(source.perturbs, ("",))[0]
            )
            names.setdefault("r_cg" if source.perturbs == "r_cg" else unknown, set()).add(source.name)
    stated = {"delay": recording.sigma_delay, "rotation": recording.sigma_rotation}
    return frozenset(
        unknown for unknown, sources in names.items() if sources <= set(redrawn) and stated.get(unknown) is None
    ) - {""}


def draw_root(source: Source, mixing: Collection[Mixing]) -> np.ndarray:
    """Return a root of the covariance of one source's draw, (n, n), its axes correlated as declared."""
    sigma = np.broadcast_to(np.asarray(source.standard_deviation, float), np.shape(source.sigma)).ravel()
    for mix in mixing:
        if source.name in mix.names:
            here = mix.places[source.name]
            return root_of(np.asarray(mix.correlation)[here, here] * np.outer(sigma, sigma))
    return np.diag(sigma)
