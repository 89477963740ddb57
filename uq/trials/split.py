"""Cases of one experiment by what they need: sums where they tell what the sources do, samples where not.

Each kind of error says what stands for it in sums beside the sources that act with it
(:meth:`uq.sources.source.ErrorKind.in_sums`). A case in which nothing is drawn is the same in every trial: where it
needs samples, these are visited once.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from identify.compiled_program import CompiledProgram
from identify.motion.trajectory import Motion, Trajectory
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import wrench
from identify.rigid_body.inertia import Body
from uq.gram_sums.delayed_omega import DelayedOmega, delayed_omega, longest_delay
from uq.gram_sums.setup import Case, cases_of
from uq.sources.constant_errors import perturbed
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing
from uq.sources.source import MANY_SIGMA, Beside, ErrorKind, Source
from uq.trials.samplewise import SampledSetup, crossed, sampled_trial
from uq.trials.trial import TrialEstimates


class SplitSetup(Pytree):
    """Set-ups of some cases each, and the estimates of those that are the same in every trial."""

    parts: tuple[Any, ...]
    """Set-ups of other engines."""
    same: TrialEstimates
    """Of the cases in which nothing is drawn."""
    cases: tuple[Case, ...] = static_field()
    """All of them."""
    order: tuple[int, ...] = static_field()
    """Where each stands among those of the parts, one part after the other, and the same ones last."""

    def joined(self, of_parts: Sequence[TrialEstimates], count: int) -> TrialEstimates:
        """Return the estimates of all cases, trials leading, from those of the parts."""
        same = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (count, *leaf.shape)), self.same)
        order = np.array(self.order)
        return jax.tree.map(lambda *leaves: jnp.concatenate(leaves, axis=2)[:, :, order], *of_parts, same)


class InSums(Pytree):
    """What sums tell of an experiment."""

    sources: tuple[Source, ...]
    """What stands for the sources; a source for itself where nothing does."""
    summed: tuple[Case, ...] = static_field()
    """Cases that sums over samples express."""
    sampled: tuple[Case, ...] = static_field()
    """Cases that need every sample."""
    same: tuple[Case, ...] = static_field()
    """Those among them that are the same in every trial."""
    delayed: DelayedOmega | None
    """The delayed angular velocity, if sources delay it."""


def in_sums(
    motion: Motion,
    trajectory: Trajectory,
    body: Body,
    sources: Sequence[Source],
    mixing: Sequence[Mixing],
    *,
    drawn: bool = False,
) -> InSums:
    """Return what sums tell of the sources on one trajectory; ``drawn``: where the gyro's sums are drawn, too."""
    delayed = None
    if "gyro_delay" in perturbed(sources):
        delayed = delayed_omega(trajectory, motion.t, longest_delay(sources))
    first, last = np.asarray(motion.t)[[0, -1]]
    rate = float((len(motion.t) - 1) / (last - first))
    remainder = 0.0 if delayed is None else delayed.remainder
    signals = (*wrench(body, motion.omega, motion.alpha, motion.specific_force_cg), motion.omega)
    largest = [np.abs(np.asarray(signal)).max(axis=1) for signal in signals]
    standing: dict[str, Source] = {}
    summed, sampled, same = [], [], []
    for case in cases_of(sources):
        acting = [source for source in sources if source.name in case.sources]
        each = {s.name: s.error_kind.in_sums(s, _beside(s, acting, mixing, rate, remainder, largest)) for s in acting}
        if None not in each.values() and not crossed(acting, mixing) and (not drawn or _drawable(acting, mixing)):
            summed.append(case)
            standing |= {name: source for name, source in each.items() if source is not None}
        elif any(source.drawn for source in acting):
            sampled.append(case)
        else:
            same.append(case)
    return InSums(tuple(standing.get(s.name, s) for s in sources), tuple(summed), tuple(sampled), tuple(same), delayed)


def _beside(
    source: Source,
    acting: Sequence[Source],
    mixing: Sequence[Mixing],
    rate: float,
    remainder: float,
    largest: Sequence[np.ndarray],
) -> Beside:
    others = [other for other in acting if other.name != source.name and other.signal == source.signal]
    mixed = {name for mix in mixing for name in mix.names}
    noise = [s for s in others if s.noise and isinstance(s.shape, Normal) and s.name not in mixed]
    variances = [variance for s in noise if (variance := s.error_kind.white_variance(s, rate)) is not None]
    white = np.sqrt(sum(variances, np.zeros(3)))
    alike = sum(other.error_kind is source.error_kind for other in others)
    spread = np.sqrt(sum((other.error_kind.added_variance(other) for other in others), np.zeros(3)))
    reach = np.zeros(3) if source.signal is None else largest[source.signal] + MANY_SIGMA * spread
    return Beside(white, alike, remainder, reach)


def _drawable(acting: Sequence[Source], mixing: Sequence[Mixing]) -> bool:
    """Return whether the sums' moments hold all noise: its filters are stated, and the gyro's has a fourth moment."""
    noise = [source for source in acting if source.noise]
    stated = all(type(source.error_kind).noise_parts is not ErrorKind.noise_parts for source in noise)
    gyro = {source.name for source in noise if source.of_gyro}
    finite = all(np.all(np.isfinite(s.shape.excess_kurtosis)) for s in noise if s.white and s.name in gyro)
    return stated and finite and not any(len(gyro & set(mix.names)) > 1 for mix in mixing)


@CompiledProgram
def first_trial(setup: SampledSetup) -> TrialEstimates:
    """Return the estimates of one trial: where nothing is drawn, of every trial."""
    return sampled_trial(setup, jax.random.key(0), jnp.zeros((), int))
