"""Constant errors of one experiment: what each source's draw amounts to, and what several amount to together.

Errors of one kind on one quantity add: two scale factors of 0.1 % are one of 0.2 %. All are smooth in the draws.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array
from uq.sources.source import Source

CELL_CHANNELS = {"F": 0, "M": 3}
"""Where force and moment begin among the load cell's channels."""

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
    """What each channel (row) adds of each component (column)."""
    cell_scale: Wrench
    """Relative error of each channel's scale factor."""
    cell_bias: Wrench
    cell_drift: Wrench
    """Slope, from the run's start [N/s, N·m/s]."""
    gyro_misalignment: Vector
    """Rotation vector in B that takes the body's axes to the gyro's [rad]."""
    gyro_scale: Vector
    gyro_bias: Vector
    gyro_drift: Vector
    """Slope, from the run's start [rad/s²]."""
    gyro_delay: Float[Array, "*cases"]
    """How much later than the wrench the angular velocity was taken [s] than the stamps say."""


def no_errors() -> Errors:
    """Return what a perfect rig has."""
    sizes = {"gravity": (), "gyro_delay": (), "displaced_air": (4,), "entrained_air": (10,), "cell_cross_talk": (6, 6)}
    wrench = {"cell_scale": (6,), "cell_bias": (6,), "cell_drift": (6,)}
    return Errors(*(np.zeros((sizes | wrench).get(name, (3,))) for name in Errors._fields))


def effect(source: Source, draw: Float[Array, "..."]) -> Errors:
    """Return what a constant source's draw [SI] amounts to: linear in it."""
    if source.perturbs is None:
        return no_errors()
    value, first = source.error_kind.value(source, draw), CELL_CHANNELS.get(source.target)
    if first is not None:  # of force or moment: three of the load cell's six channels
        value = jnp.concatenate([jnp.zeros(first), value, jnp.zeros(3 - first)])
    return no_errors()._replace(**{source.perturbs: value})


def errors_of_cases(sources: Sequence[Source], draws: Mapping[str, Array], cases: Sequence[frozenset[str]]) -> Errors:
    """Return the errors that act in each case, a set of names of sources; the cases on the leading axis."""
    constant = [source for source in sources if source.constant]
    effects = [no_errors(), *(effect(source, draws[source.name].astype(float)) for source in constant)]
    acting = jnp.asarray([[1.0, *(float(s.name in case) for s in constant)] for case in cases]).reshape(
        len(cases), len(effects)
    )
    return jax.tree.map(lambda *parts: jnp.tensordot(acting, jnp.stack(parts), axes=1), *effects)


def errors_of(sources: Sequence[Source], draws: Mapping[str, Array]) -> Errors:
    """Return the errors of all constant sources together: smooth in the draws."""
    together = errors_of_cases(sources, draws, [frozenset(source.name for source in sources)])
    return jax.tree.map(lambda leaf: leaf[0], together)


def perturbed(sources: Sequence[Source]) -> frozenset[str]:
    """Return the names of the fields of :class:`Errors` that some source sets."""
    return frozenset(source.perturbs for source in sources if source.perturbs)


def declared_sigma(sources: Sequence[Source], field: str) -> np.ndarray:
    """Return the standard deviation of one field of :class:`Errors`, of all sources that set it together; SI."""
    effects = [effect(s, jnp.asarray(s.standard_deviation)) for s in sources if s.perturbs == field]
    zero = np.zeros(getattr(no_errors(), field).shape)
    return np.asarray(np.sqrt(sum((np.square(getattr(each, field)) for each in effects), zero)))
