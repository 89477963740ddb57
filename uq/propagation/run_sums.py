"""Sums over a trajectory's samples, for the law: in pieces of one size, so that any duration runs the same code.

What is compiled depends on neither duration nor rate, and no more than a piece is ever in memory.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.compiled_program import CompiledProgram
from identify.motion.trajectory import Trajectory, sample
from identify.rigid_body.inertia import Body
from uq.gram_sums.error_maps import Columns, Platform, true_elements
from uq.gram_sums.sums_over_samples import PieceSums, alphas_of, moments_of_sums, responses_of, sums_of_piece
from uq.propagation.beyond_the_law import Peaks
from uq.propagation.expansion import NoiseFreeRun, RunSums, TrueSums

PIECE = 4096
"""Samples in a piece."""


class _Sums(NamedTuple):
    """Sums over some pieces of a run."""

    piece: PieceSums
    true: tuple[TrueSums, TrueSums, TrueSums]
    moved: Float[Array, "9"]
    """Squares of what force, moment and omega go from one sample to the next."""
    largest: Float[Array, "9"]
    """Largest absolute value of force, moment and omega; it is a maximum, not a sum."""


def _numbers(first: Array, margin: int) -> Array:
    """The numbers of a piece's samples and of ``margin`` more at either end; some may lie outside of the run."""
    return first - margin + jnp.arange(PIECE + 2 * margin)


def run_sums(
    trajectory: Trajectory, count: int, rate: float, body: Body, platform: Platform, taps: Sequence[Array],
    columns: Columns, delayed: bool,
) -> tuple[RunSums, Peaks]:  # fmt: skip
    """Sum over a run's samples.

    Args:
        trajectory: the motion.
        count: samples from 0 on.
        rate: at which they are taken [Hz].
        body: that is moved.
        platform: what carries it.
        taps: every estimator's differentiator.
        columns: the functions of time that the sources need.
        delayed: whether the sums' derivatives by a delay of the gyro are needed.

    Returns:
        The sums, and how far the signals go.
    """
    margin, start = 3 * max(map(len, taps)), jnp.eye(3)
    given = trajectory, platform, jnp.asarray(rate, float), jnp.asarray(count), margin, delayed
    sums: Any = ()
    for first in map(jnp.asarray, range(0, count, PIECE)):
        motion, by_delay, start = _moved(first, start, *given)
        more = _summed(motion, by_delay, body, list(taps), first, given[3], columns)
        sums = _together(sums, more) if sums else more
    largest, moved = np.asarray(sums.largest), np.sqrt(np.asarray(sums.moved) / max(count - 1, 1))
    places = {"F": slice(0, 3), "M": slice(3, 6), "omega": slice(6, 9)}
    peaks = Peaks(*({name: each[place] for name, place in places.items()} for each in (largest, moved)))
    return RunSums(NoiseFreeRun(body, platform, sums.true, columns), _moments(sums.piece, list(taps))), peaks


@CompiledProgram
def _moved(first, start, trajectory, platform, rate, count, margin, delayed):
    """A piece's motion; the first and second derivatives of omega by a delay; the attitude where the next one starts.

    ``start`` is the attitude at the first sample. Before and after the run the body is at rest.
    """
    t = jnp.clip(_numbers(first, margin), 0, count - 1).astype(rate.dtype) / rate
    still, gravity = platform.r_cg_from_still, platform.gravity
    motion = sample(trajectory, t, r_cg_from_still=still, gravity=gravity, start=start)
    if not delayed:
        return motion, (), motion.rotation[PIECE]
    unit = jnp.ones(())
    late = lambda delay: jax.vmap(trajectory.omega, out_axes=1)(t - delay)  # noqa: E731
    slope = lambda delay: jax.jvp(late, (delay,), (unit,))[1]  # noqa: E731
    return motion, jax.jvp(slope, (jnp.zeros(()),), (unit,)), motion.rotation[PIECE]


@CompiledProgram
def _summed(motion, by_delay, body, taps, first, count, columns):
    """The sums over a piece, given what :func:`_moved` returns."""
    reach = max(map(len, taps))
    index, inner = _numbers(first, 3 * reach), slice(3 * reach, 3 * reach + PIECE)
    valid = ((index >= reach) & (index < count - reach)).astype(motion.t.dtype)[None]
    wrench = columns.sampled(body, motion, 0.0)

    def true_sums(delay):
        omega = motion.omega
        if by_delay:
            omega = omega + delay * by_delay[0] + delay**2 / 2 * by_delay[1]
        phi = jnp.concatenate([true_elements(omega, omega, motion.t), alphas_of(omega, taps)]) * valid
        return TrueSums(phi[:, inner] @ phi[:, inner].T, phi[:, inner] @ wrench[:, inner].T)

    slope = lambda delay: jax.jvp(true_sums, (delay,), (jnp.ones(()),))[1]  # noqa: E731
    now = true_sums(jnp.zeros(()))
    none = jax.tree.map(jnp.zeros_like, now)
    derivatives = jax.jvp(slope, (jnp.zeros(()),), (jnp.ones(()),)) if by_delay else (none, none)
    rows = jnp.concatenate([valid, jnp.concatenate([motion.omega, alphas_of(motion.omega, taps), wrench[:6]]) * valid])
    sensed = jnp.concatenate([wrench[:6], motion.omega])
    there = ((index >= 0) & (index < count)).astype(motion.t.dtype)[None]
    steps = jnp.pad(jnp.diff(sensed) * there[:, 1:], ((0, 0), (1, 0)))
    return _Sums(
        sums_of_piece(rows[:, reach:-reach], responses_of(taps)), (now, *derivatives),
        jnp.sum(steps[:, inner] ** 2, axis=1), jnp.max(jnp.abs(sensed * there)[:, inner], axis=1),
    )  # fmt: skip


@jax.jit
def _together(first, second):
    return jax.tree.map(jnp.add, first, second)._replace(largest=jnp.maximum(first.largest, second.largest))


@jax.jit
def _moments(sums, taps):
    return moments_of_sums(sums, responses_of(taps))
