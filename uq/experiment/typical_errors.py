"""Errors that an experiment does not declare, at the typical sizes of ``[undeclared]``, as sources."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uq.experiment.experiment import Experiment
from uq.sources.draws import Mixing
from uq.sources.source import Source, kind_of


class Kind(NamedTuple):
    """An error as it is said, and as the source that it would be declared as."""

    text: str
    unit: str
    per_si: float
    """Factor from SI to the unit."""
    target: str = ""
    kind: str = ""
    common: bool = False
    """Whether one number errs on all axes."""


KINDS: Mapping[str, Kind] = {
    "force_gain": Kind("common gain of the force", "%", 100, "F", "scale", common=True),
    "force_gain_by_axis": Kind("gain of each force", "%", 100, "F", "scale"),
    "moment_gain": Kind("common gain of the moment", "%", 100, "M", "scale", common=True),
    "moment_gain_by_axis": Kind("gain of each moment", "%", 100, "M", "scale"),
    "cross_talk": Kind("cross-talk of the load cell", "%", 100, "wrench", "cross_talk"),
    "load_cell_axes": Kind("misalignment of the load cell", "mrad", 1e3, "wrench", "misalignment"),
    "gyro_scale": Kind("scale of the gyro", "%", 100, "omega", "scale"),
    "gyro_axes": Kind("misalignment of the gyro", "mrad", 1e3, "omega", "misalignment"),
    "delay": Kind("delay of the gyro", "ms", 1e3, "omega", "delay"),
    "mass": Kind("error of the mass", "%", 100),
    "centre_of_gravity": Kind("error of r_CG", "mm", 1e3, "r_cg", "bias"),
    "gravity": Kind("error of gravity", "m/s²", 1, "gravity", "bias"),
    "mounting_frequency": Kind("flexibility of the mounting", "Hz", 1),
    "accelerometer_scale": Kind("scale of the accelerometer", "%", 100),
    "accelerometer_place": Kind("place of the accelerometer", "mm", 1e3),
}
"""Description of each error by its key in ``[undeclared]``."""


def typical_errors(experiment: Experiment, largest: tuple[float, float]) -> Experiment:
    """Return the experiment whose sources are the errors that it does not declare, at typical size, and no others.

    Args:
        experiment: its sources, and the typical figures.
        largest: full scale of force [N] and moment [N·m], of which cross-talk is a part; zero: no cross-talk.
    """
    declared = {(source.perturbs, source.signal) for source in experiment.sources}
    sources, mixing = [], []
    for name, error in KINDS.items():
        figure = getattr(experiment.undeclared, name)
        if figure is None or not error.kind:
            continue
        kind = kind_of(error.target, error.kind)
        is_fraction = len(kind.figures(error.target).wholes(None)) < math.prod(kind.shape)
        if is_fraction and not all(largest):
            continue
        stated = np.array(figure) if is_fraction else np.full(kind.shape, figure)
        sigma = kind.figures(error.target).placed(stated, np.repeat(largest, 3))
        source = Source(name=name, target=error.target, kind=error.kind, group="undeclared", sigma=sigma)
        if (source.perturbs, source.signal) in declared:
            continue
        sources.append(source)
        if error.common:
            mixing.append(Mixing(names=(name,), axes=(3,), correlation=np.ones((3, 3))))
    return replace(experiment, sources=tuple(sources), mixing=tuple(mixing), document={})
