"""Which draws a trial needs, and which of them change the samples of omega together."""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float, Int, Key

from uq.gram_sums.error_maps import OF_THE_GYRO, gyro_map
from uq.gram_sums.setup import Setup
from uq.sources.constant_errors import errors_of_cases
from uq.sources.distributions import Normal
from uq.sources.draws import draw_constants
from uq.sources.source import Source


class Plan(NamedTuple):
    """Which draws a setup needs, by its static part."""

    gyro: tuple[Source, ...]
    """Sources of noise of omega."""
    late: tuple[frozenset[str], ...]
    """The sets of sources that act together in some case where omega is late: delays, and errors that map omega."""
    sampled: tuple[Source, ...]
    """Sources of noise of force and moment that are drawn sample by sample."""
    conditioned: tuple[Source, ...]
    """Those whose sums are drawn."""
    acting: np.ndarray
    """Variant by variant, which of ``gyro``, then of ``late``, change the samples of omega together in some case."""
    of_case: tuple[int, ...]
    """Which variant each case has, counted from 1; 0 where nothing changes them."""


def plan_of(setup: Setup) -> Plan:
    """Return the plan of a set-up."""
    noise = [source for source in setup.sources if source.noise]
    gyro = tuple(source for source in noise if source.of_gyro)
    cell = [source for source in noise if not source.of_gyro]
    in_sums = [setup.sampling == "conditioned" and s.white and isinstance(s.shape, Normal) for s in cell]
    sampled, conditioned = (
        tuple(s for s, drawn in zip(cell, in_sums, strict=True) if drawn is which) for which in (False, True)
    )
    delays = {source.name for source in setup.sources if source.perturbs == "gyro_delay"}
    maps = {source.name for source in setup.sources if source.perturbs in OF_THE_GYRO}  # what is late is mapped, too
    sets = [case.sources & (delays | maps) if case.sources & delays else None for case in setup.cases]
    late = tuple(dict.fromkeys(names for names in sets if names is not None))
    rows = [
        (*(source.name in case.sources for source in gyro), *(names == each for each in late))
        for case, names in zip(setup.cases, sets, strict=True)
    ]
    variants = list(dict.fromkeys(row for row in rows if any(row)))
    of_case = tuple(variants.index(row) + 1 if any(row) else 0 for row in rows)
    acting = np.array(variants, float).reshape(len(variants), len(gyro) + len(late))
    return Plan(gyro, late, sampled, conditioned, acting, of_case)


class Late(NamedTuple):
    """How late omega is, of each set of ``Plan.late``."""

    part: Float[Array, " sets"]
    """The delay, in parts of the longest."""
    gyro: Float[Array, "sets 3 3"]
    """The gyro's map."""


def late_of(setup: Setup, plan: Plan, key: Key[Array, ""], index: Int[Array, ""]) -> Late:
    """Return how late omega is in one trial."""
    draws = draw_constants(setup.sources, setup.mixing, key, index, setup.dtype)
    errors = errors_of_cases(setup.sources, draws, plan.late)
    return Late(*(x.astype(setup.dtype) for x in (errors.gyro_delay / setup.reach, jax.vmap(gyro_map)(errors))))
