"""Errors of the rig that a calibration leaves open: declared, or at typical size, each as a source and as a prior."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from identify.errors.imu.accelerometer_axes import ACCELEROMETER_AXES
from identify.errors.imu.gyro_axes import GYRO_AXES
from identify.errors.rig.mounting import MOUNTING
from identify.estimation.joint.priors import Alignment, ConstantError
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import figures_of, typical_errors
from uq.runs.identification.estimated_errors import correlated_set, declared_error, draw_root, estimated_errors
from uq.sources.constant_errors import declared_sigma
from uq.sources.draws import Mixing
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Source, kind_of

ALIGNED = {"delay": ("omega", "delay"), "rotation": ("omega", "misalignment")}
"""Target and kind of a source for each unknown that the alignment has."""


@dataclass(frozen=True)
class OpenErrors:
    """The priors of a rig's errors."""

    experiment: Experiment
    """The experiment, its sources those errors of load cell and IMU that are the rig's, declared or typical."""
    priors: Mapping[str, ConstantError]
    """Priors of all errors that are open, by the name of the source, or of the error."""

    def parts(self, alignment: Alignment) -> Iterator[tuple[Source, str, Float[np.ndarray, "n k"]]]:
        """Yield each source, the name of its axes, and what one standard uncertainty of each axis adds to its draw."""
        for source in self.experiment.sources:
            root = draw_root(source, self.experiment.mixing)
            yield source, correlated_set(source, self.experiment) or source.name, root
        present = {error.unknown for error in self.priors.values()}
        for name, (target, kind) in ALIGNED.items():
            if name in present:
                continue
            shape = (3,) if name == "rotation" else ()
            sigma = np.array(np.broadcast_to(getattr(alignment, f"sigma_{name}"), shape), float)
            mean = np.array(getattr(alignment, name), float)
            source = Source(name=name, target=target, kind=kind, group="alignment", sigma=sigma, mean=mean)
            yield source, name, np.diag(np.atleast_1d(sigma))


def open_errors(
    experiment: Experiment, duration: float, largest: tuple[float, float], *, aligned: bool, absent: frozenset[str]
) -> OpenErrors:
    """Return the errors of a rig that are open in a calibration.

    Args:
        experiment: its sources, and the typical figures of what it does not declare.
        duration: of a run [s].
        largest: full scale of force [N] and moment [N·m], of which cross-talk is a part; zero: no cross-talk.
        aligned: whether the alignment has delay and rotation of the IMU, as with the method ``joint``.
        absent: what is not there, of :attr:`identify.errors.error_model.ErrorModel.needs`.
    """
    typical, declared = typical_errors(experiment, largest), {(s.target, s.kind) for s in experiment.sources}
    added = [*typical.sources, *_by_act(experiment, declared, absent)]
    names = {source.name for source in experiment.sources}
    renamed = {source.name: f"typical_{source.name}" for source in added if source.name in names}
    mixing = tuple(
        Mixing(tuple(renamed.get(name, name) for name in mix.names), mix.axes, mix.correlation)
        for mix in typical.mixing
    )
    added = [replace(source, name=renamed.get(source.name, source.name)) for source in added]
    every = replace(experiment, sources=(*experiment.sources, *added), mixing=(*experiment.mixing, *mixing))
    priors = estimated_errors(every, duration, experiment.recording.drawn_by_mounting)
    if aligned:
        priors = {name: error for name, error in priors.items() if error.unknown not in ALIGNED}
    sources = tuple(
        source for source in every.sources if priors.get(source.name) and priors[source.name].shared and _is_rig(source)
    )
    if "mounting" not in absent and (figure := experiment.undeclared.mounting_frequency) is not None:
        axes = MOUNTING.typical_numbers(figure)  # which no source declares
        priors[MOUNTING.name] = ConstantError(MOUNTING.name, np.zeros(MOUNTING.count), axes @ axes.T, root=axes)
    return OpenErrors(replace(every, sources=sources), priors)


def _by_act(experiment: Experiment, declared: Collection[tuple[str, str]], absent: frozenset[str]) -> Iterator[Source]:
    """Sources of typical size of the errors that are declared by their file alone, and are not."""
    figures = dict(figures_of(experiment))
    if ACCELEROMETER_AXES not in figures:  # against the gyro, whose own turn the IMU's rotation is
        of_gyro = declared_sigma(experiment.sources, "gyro_misalignment").max()
        figures[ACCELEROMETER_AXES] = float(np.hypot(of_gyro, figures.get(GYRO_AXES, 0.0)))
    for error, figure in figures.items():
        place = error.declared_as
        if place is None or place in declared or error.needs & absent or not figure > 0:
            continue
        if isinstance(kind_of(*place), ErrorByAct):
            shape = kind_of(*place).shape
            yield Source(name=error.name, target=place[0], kind=place[1], group="typical", sigma=np.full(shape, figure))


def _is_rig(source: Source) -> bool:
    """Whether a source is an error of load cell or IMU that lasts from run to run."""
    error = declared_error(source)
    return error is not None and error.scope == "rig" and error.part not in ("body", "rig")
