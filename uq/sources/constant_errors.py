"""Constant errors of one experiment: what each source's draw amounts to, and what several amount to together.

Errors of one kind on one quantity add: two scale factors of 0.1 % are one of 0.2 %. All are smooth in the draws,
arrays of JAX or of NumPy. What no source sets is zero and stays an array of NumPy, of which JAX traces nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array, library_of
from uq.sources.source import Draw, Source

CELL_CHANNELS = {"F": 0, "M": 3}
"""Index of the first channel of force and of moment among the load cell's channels."""

Vector = Float[Array, "*cases 3"]
Wrench = Float[Array, "*cases 6"]


class Errors(NamedTuple):
    """Constant errors, in SI; all zero when nothing errs. Force stands before moment."""

    r_cg: Vector
    """Believed minus true centre of gravity from Q, in B [m]."""
    gravity: Float[Array, "*cases"]
    """True minus stated gravity [m/s²]."""
    r_cg_from_omb: Vector
    """True minus believed centre of gravity from the platform's centre, in B [m]: another point keeps still."""
    tilt: Vector
    """Rotation vector in A that takes the level attitude to the true one at the start [rad]."""
    displaced_air: Float[Array, "*cases 4"]
    """Mass of the displaced air, and mass times its centre from the centre of gravity [kg, kg·m]."""
    entrained_air: Float[Array, "*cases 10"]
    """Mass of the air that moves along, mass times its centre from the centre of gravity, and its packed tensor about
    the centre of gravity [kg, kg·m, kg·m²]."""
    cell_misalignment: Vector
    """Rotation vector in B that takes the body's axes to the load cell's [rad]."""
    cell_cross_talk: Float[Array, "*cases 6 6"]
    """Cross-talk of the load cell: the part of each component (column) that each channel (row) adds."""
    cell_scale: Wrench
    """Relative error of the scale factor of each channel."""
    cell_bias: Wrench
    cell_drift: Wrench
    """Slope of the load cell's drift, from the run's start [N/s, N·m/s]."""
    gyro_misalignment: Vector
    """Rotation vector in B that takes the body's axes to the gyro's [rad]."""
    gyro_scale: Vector
    gyro_bias: Vector
    gyro_drift: Vector
    """Slope of the gyro's drift, from the run's start [rad/s²]."""
    gyro_delay: Float[Array, "*cases"]
    """Delay of the angular velocity's samples against those of the wrench, beyond what the stamps say [s]."""


def no_errors() -> Errors:
    """Return what a perfect rig has."""
    sizes = {"gravity": (), "gyro_delay": (), "displaced_air": (4,), "entrained_air": (10,), "cell_cross_talk": (6, 6)}
    wrench = {"cell_scale": (6,), "cell_bias": (6,), "cell_drift": (6,)}
    return Errors(*(np.zeros((sizes | wrench).get(name, (3,))) for name in Errors._fields))


ENDS = np.cumsum([zero.size for zero in no_errors()]).tolist()
PLACES = dict(zip(Errors._fields, map(slice, [0, *ENDS[:-1]], ENDS), strict=True))
"""Places of each field's numbers among all of them in one array."""


def unravel(errors: Float[Array, " e"]) -> Errors:
    """Return errors from all their numbers in one array, of JAX or of NumPy."""
    return Errors(
        *(errors[place].reshape(zero.shape) for place, zero in zip(PLACES.values(), no_errors(), strict=True))
    )


def effect(source: Source, draw: Draw) -> Draw:
    """Return what a constant source's draw [SI] adds to the field that it perturbs: linear in it."""
    value, first = source.error_kind.value(source, draw), CELL_CHANNELS.get(source.target)
    if first is None or source.perturbs is None:
        return value
    # of force or moment: three of the load cell's six channels
    return library_of(value).concat([np.zeros(first), value, np.zeros(3 - first)])


def errors_of_cases(sources: Sequence[Source], draws: Mapping[str, Array], cases: Sequence[frozenset[str]]) -> Errors:
    """Return the errors that act in each case, a set of names of sources; the cases on the leading axis.

    Sources that set no field (:class:`uq.sources.recorded_kinds.ErrorByAct`) are not among them.
    """
    effects: dict[str, list[Draw]] = {}
    acting: dict[str, list[list[float]]] = {}
    for source in sources:
        if source.constant and (field := source.perturbs) is not None:
            effects.setdefault(field, []).append(effect(source, draws[source.name].astype(float)))
            acting.setdefault(field, []).append([float(source.name in case) for case in cases])
    fields = {field: np.zeros((len(cases), *zero.shape)) for field, zero in no_errors()._asdict().items()}
    for field, parts in effects.items():
        xp, nothing = library_of(*parts), np.zeros(len(cases))
        # two columns at least: XLA would make each draw anew wherever a product of one is used
        weights = xp.asarray([nothing, *acting[field]]).T
        fields[field] = xp.tensordot(weights, xp.stack([xp.zeros_like(parts[0]), *parts]), axes=1)
    return Errors(**fields)


def errors_of(sources: Sequence[Source], draws: Mapping[str, Array]) -> Errors:
    """Return the errors of all constant sources together: smooth in the draws."""
    together = errors_of_cases(sources, draws, [frozenset(source.name for source in sources)])
    return Errors(*(leaf[0] for leaf in together))


def over_cases(function: Callable[..., Any], errors: Sequence[Errors]) -> Any:
    """Return what a function of errors gives in each case: ``vmap``, with zeros not traced.

    Args:
        function: of one case's errors, one argument each.
        errors: of :func:`errors_of_cases`.
    """
    moving = [{field: x for field, x in case._asdict().items() if not isinstance(x, np.ndarray)} for case in errors]
    return jax.vmap(lambda cases: function(*(no_errors()._replace(**case) for case in cases)))(moving)


def perturbed(sources: Sequence[Source]) -> frozenset[str]:
    """Return the names of the fields of :class:`Errors` that some source sets."""
    return frozenset(source.perturbs for source in sources if source.perturbs)


def declared_sigma(sources: Sequence[Source], field: str) -> np.ndarray:
    """Return the standard deviation of one field of :class:`Errors`, of all sources that set it together; SI."""
    effects = [effect(source, source.standard_deviation) for source in sources if source.perturbs == field]
    return np.asarray(np.sqrt(sum(map(np.square, effects), np.zeros(getattr(no_errors(), field).shape))))


def declared_mean(sources: Sequence[Source], field: str) -> np.ndarray:
    """Return the expectation of one field of :class:`Errors`, of all sources that set it together; SI."""
    effects = [
        effect(source, np.broadcast_to(source.mean, np.shape(source.sigma)))
        for source in sources
        if source.perturbs == field
    ]
    return np.asarray(sum(effects, np.zeros(getattr(no_errors(), field).shape)))
