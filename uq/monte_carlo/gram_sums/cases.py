"""The cases of a breakdown, and the estimators that solve each of them."""

from collections.abc import Sequence
from typing import NamedTuple

from jaxtyping import Array, Float

from identify.pytree import Pytree, static_field
from uq.sources.source import Source


class Estimator(Pytree):
    """A way from recorded signals to the tensor: ordinary least squares with a differentiator."""

    name: str = static_field()
    taps: Float[Array, " h"]
    """Taps of the differentiator [1/s]; see :mod:`identify.signals.differentiate`."""


class Case(NamedTuple):
    """A set of sources that act together while the others are off."""

    name: str
    sources: frozenset[str]


def cases_of(sources: Sequence[Source]) -> tuple[Case, ...]:
    """Return the cases of the breakdown: all sources, each group, each source."""
    groups = dict.fromkeys(source.group for source in sources)
    return (
        Case("total", frozenset(source.name for source in sources)),
        *(Case(f"group:{name}", frozenset(s.name for s in sources if s.group == name)) for name in groups),
        *(Case(f"source:{source.name}", frozenset([source.name])) for source in sources),
    )
