"""Errors that an experiment does not declare, at the typical sizes of ``[undeclared]``, as sources."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identify.errors.error_model import ErrorModel
from identify.errors.registry import ERRORS
from uq.experiment.experiment import Experiment
from uq.sources.draws import Mixing
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Draw, Source, kind_of


def figures_of(experiment: Experiment) -> Iterator[tuple[ErrorModel, float]]:
    """Yield the errors that there may be, each with its typical figure, in the table's order."""
    for name, figure in experiment.undeclared.to_dict().items():
        if figure is not None:
            yield ERRORS[name], figure


def typical_errors(experiment: Experiment, largest: tuple[float, float]) -> Experiment:
    """Return the experiment whose sources are the errors that it does not declare, at typical size, and no others.

    Args:
        experiment: its sources, and the typical figures.
        largest: full scale of force [N] and moment [N·m], of which cross-talk is a part; zero: no cross-talk.
    """
    declared = {(source.perturbs, source.signal) for source in experiment.sources}
    sources, mixing = [], []
    for error, figure in figures_of(experiment):
        if error.declared_as is None or isinstance(kind_of(*error.declared_as), ErrorByAct):
            continue
        target, name = error.declared_as
        kind = kind_of(target, name)
        figures = kind.figures(target)
        is_fraction = len(figures.wholes(None)) < math.prod(kind.shape)
        if is_fraction and not all(largest):
            continue
        stated = np.array(figure) if is_fraction else np.full(kind.shape, figure)
        sigma = figures.placed(stated, np.repeat(largest, 3))
        source = Source(name=error.name, target=target, kind=name, group="undeclared", sigma=sigma)
        if (source.perturbs, source.signal) in declared:
            continue
        sources.append(source)
        if is_common(error, sigma):
            mixing.append(Mixing(names=(error.name,), axes=(3,), correlation=np.ones((3, 3))))
    return replace(experiment, sources=tuple(sources), mixing=tuple(mixing), document={})


def is_common(error: ErrorModel, sigma: Draw) -> bool:
    """Return whether one number errs on all axes of a source."""
    return error.count == 1 < np.size(sigma)
