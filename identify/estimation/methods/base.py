"""The estimators' interface: the problem that they are given, and their abstract class."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np

from identify.choices import CgMotion, OffsetChoice
from identify.estimation import methods
from identify.estimation.joint.priors import Alignment, ConstantError
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError
from identify.results.identification_result import Identification
from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run

R = TypeVar("R")
RunMap = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Function as the builtin ``map``, which may work on several items at a time, each in another process."""
SHORTEST = 64
"""Least number of samples for the motion's band."""


@dataclass(frozen=True)
class Problem:
    """Runs of one body and the priors; arguments of :func:`identify.identify`, checked."""

    runs: tuple[Run, ...]
    r_cg: np.ndarray
    """Centre of gravity from Q, in B [m]."""
    sigma_r_cg: np.ndarray
    """Standard uncertainty of ``r_cg`` on each axis [m]."""
    estimator: EstimatorSpec | None = None
    """Differentiator and filter of angular velocity; None: the estimator chooses them, see :meth:`band`."""
    offsets: OffsetChoice = "estimate"
    mass: float | None = None
    """Mass of the body [kg]; None: not stated."""
    mass_uncertainty: float | None = None
    """Standard uncertainty of ``mass`` [kg]; None: the mass counts as exact."""
    centre: Centre | None = None
    """Mass and centre of gravity from static poses, with their covariance; then ``r_cg`` and ``mass`` are its."""
    alignment: Alignment | None = None
    cg_motion: CgMotion | None = None
    gravity: float = STANDARD_GRAVITY
    """Local gravity that is stated [m/s²]."""
    errors: Mapping[str, ConstantError] = field(default_factory=dict)
    """Declared constant errors by the name of their source, for an estimator that takes them along."""
    drawn_by_mounting: frozenset[str] = frozenset()
    """Unknowns of the joint model that are others in each mounting, as far as the runs name theirs."""
    map_runs: RunMap = map
    """Function that does what is done run by run."""

    def by_run(self, function: Callable[[Run], R]) -> list[R]:
        """Return what a function, which can be pickled, makes of each run."""
        return list(self.map_runs(function, self.runs))

    @property
    def without_mountings(self) -> "Problem":
        """The problem of runs that do not name their mountings, with errors that all of them share."""
        runs = tuple(replace(run, mounting=None) for run in self.runs)
        errors = {name: error._replace(shared=True) for name, error in self.errors.items()}
        return replace(self, runs=runs, errors=errors, drawn_by_mounting=frozenset())

    @cached_property
    def band(self) -> float:
        """Highest frequency at which force and moment are compared with the motion [Hz].

        That of the fastest motion, at most the cut-off of a named low-pass: above it the moment may be filtered and the
        gyro may vibrate, by the user's own word.

        Raises:
            RunError: a run is too short to find it in.
        """
        for run in self.runs:
            samples = len(run.omega[run.longest_segment])
            if samples < SHORTEST:
                raise RunError(
                    f"{run.name} has {samples} samples, fewer than the {SHORTEST} from which a motion's band is found: "
                    "record for longer, or name an estimator"
                )
        lowpass = None if self.estimator is None else self.estimator.lowpass
        return min(max(run.band for run in self.runs), lowpass or np.inf)


class Method(ABC):
    """A way from runs to the tensor."""

    type_a: ClassVar[str] = ""
    """Sentence for a certificate on the type A evaluation of the runs."""
    estimates: ClassVar[frozenset[str]] = frozenset()
    """Names of the quantities that are estimated along with the tensor, so that its covariance holds their uncertainty:
    ``mass``, and constant errors (``cell_bias``, ``gyro_scale``, ``gyro_delay`` …)."""

    @abstractmethod
    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty.

        Raises:
            RunError: runs that it cannot use.
        """


def estimator_of(name: str) -> Method:
    """Return the estimator of this name."""
    return methods.ENTRIES[name].load()()
