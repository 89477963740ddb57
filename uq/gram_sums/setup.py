"""What a trial needs besides its key: cases, estimators, the noise-free run in blocks and its sums."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from identify.estimators.gram import Sums
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import ALPHA
from uq.gram_sums.error_maps import Columns, Platform
from uq.sources.draws import Mixing
from uq.sources.source import Source

Sampling = Literal["conditioned", "samples", "collapsed"]
SHARED = ALPHA.start
"""Features that all estimators share: all but alpha."""


class Estimator(Pytree):
    """A way from recorded signals to the tensor: ordinary least squares with a differentiator."""

    name: str = static_field()
    taps: Float[Array, " h"]
    """Taps of the differentiator [1/s]; see :mod:`identify.signals.differentiate`."""


class Case(NamedTuple):
    """A set of sources that act together while the others are off."""

    name: str
    sources: frozenset[str]


class Signals(NamedTuple):
    """The noise-free run in blocks, block first (without that axis inside the scan).

    A block starts earlier than the block of draws by as many samples as the longest differentiator reaches: all the
    noise that its derivatives need is then in this block of draws and the one before.
    """

    block: Int[Array, "*blocks"]
    """Number of the block."""
    noise_free: Float[Array, "*blocks rows 1200"]
    """The elements without noise: those that all estimators share, each one's alpha, and zeros for the noisy ones of
    errors that map the angular velocity; all zero where a sample does not count. Then force [N] and moment [N·m] and
    the other functions of :class:`uq.gram_sums.error_maps.Columns`."""
    valid: Float[Array, "*blocks 1200"]
    """1 where every estimator has a derivative, else 0."""
    displacement: Float[Array, "*blocks degree signals 3 1200"]
    """What each power of a delay adds to omega and every estimator's alpha
    (:class:`uq.gram_sums.delayed_omega.DelayedOmega`); degree zero where nothing is delayed."""


class Setup(Pytree):
    """Everything that a trial needs besides its key: one trajectory, one body, its sources and estimators."""

    body: Body
    platform: Platform
    signals: Signals
    reach: Float[Array, ""]
    """Delay by which the powers of ``signals.displacement`` are divided [s]."""
    rate: Float[Array, ""]
    """Sample rate [Hz]."""
    sums: Sums
    """Noise-free sums over all elements."""
    other: Float[Array, "elements other"]
    """Sums of the elements with the columns that follow the wrench."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    estimators: tuple[Estimator, ...]
    cases: tuple[Case, ...] = static_field()
    columns: Columns = static_field()
    gyro_mapped: bool = static_field()
    """Whether errors map the angular velocity, so that the elements are not the features but what these are made of."""
    dtype: np.dtype = static_field()
    """Precision of draws and features; sums and solutions have the default precision."""
    sampling: Sampling = static_field()

    @property
    def changed(self) -> slice:
        """Which elements the gyro's noise changes: all features but 1, or the noisy elements."""
        count = len(self.sums.gram)
        return slice(count - noisy_count(self.gyro_mapped, self.estimators), count)


class EqualRotations(Pytree):
    """Set-ups of one rotation that carry the body at different points, so that only the true wrench is another.

    The gyro's noise, most of a trial's work, is drawn and summed once for all of them.
    """

    setups: tuple[Setup, ...]
    signals: Signals
    """Of the first, with the rows of wrench and other columns of all."""

    @classmethod
    def of(cls, setups: Sequence[Setup]) -> "EqualRotations":
        """Put set-ups together whose elements, sources and estimators are the same."""
        first, elements = setups[0], len(setups[0].sums.gram)
        rows = [first.signals.noise_free, *(setup.signals.noise_free[:, elements:] for setup in setups[1:])]
        empty = first.signals._replace(noise_free=jnp.zeros(0), valid=jnp.zeros(0), displacement=jnp.zeros(0))
        return cls(
            tuple(replace(setup, signals=empty) for setup in setups),
            first.signals._replace(noise_free=jnp.concatenate(rows, axis=1)),
        )

    def rows(self, number: int) -> np.ndarray:
        """Return where the elements and the columns of one set-up stand among the rows of the signals."""
        elements, rows = len(self.setups[0].sums.gram), self.signals.noise_free.shape[-2]
        columns = (rows - elements) // len(self.setups)
        return np.r_[:elements, elements + number * columns : elements + (number + 1) * columns]


def cases_of(sources: Sequence[Source]) -> tuple[Case, ...]:
    """Return the cases of the breakdown: all sources, each group, each source."""
    groups = dict.fromkeys(source.group for source in sources)
    return (
        Case("total", frozenset(source.name for source in sources)),
        *(Case(f"group:{name}", frozenset(s.name for s in sources if s.group == name)) for name in groups),
        *(Case(f"source:{source.name}", frozenset([source.name])) for source in sources),
    )


def noisy_count(gyro_mapped: bool, estimators: Sequence[Estimator]) -> int:
    """How many elements, the last ones, the gyro's noise changes."""
    return (21 if gyro_mapped else SHARED - 1) + 3 * len(estimators)
