"""Sums over a trajectory's samples, for the law: in pieces of one size, so that any duration runs the same code.

What JAX compiles, the motion, depends on neither duration nor rate, and no more than a piece is ever in memory.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import add
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.trajectory import Motion, Trajectory, sample
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import Array
from identify.signals.differentiate import padded_derivative
from uq.analysis.propagation.uncovered_sources import Peaks
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis, true_elements
from uq.monte_carlo.gram_sums.noise_moments import PIECE, RunMoments, run_moments
from uq.monte_carlo.gram_sums.run_sums import RunSums
from uq.sources.source import SIGNALS

REST = 1e-9
"""Change from one sample to the next, in parts of the signal's largest value, up to which it rests."""


class _Piece(NamedTuple):
    """A part of a run, and as many samples more at either end as three times the longest differentiator's reach."""

    motion: Motion
    by_delay: Float[np.ndarray, "orders 3 n"]
    """Derivatives of omega by a delay of the gyro, the first and the second; none where there is no delay."""
    numbers: np.ndarray
    """Numbers of the samples; some may lie outside of the run."""


@dataclass(frozen=True)
class _PieceSums:
    """Sums over some pieces of a run."""

    sums: RunSums
    moments: RunMoments
    squared_steps: Float[np.ndarray, "9"]
    """Sums of squares of the changes of force, moment and omega from one sample to the next."""
    resting_steps: Float[np.ndarray, "9"]
    """Number of samples after which they do not change."""
    largest: Float[np.ndarray, "9"]
    """Largest absolute value of force, moment and omega; it is a maximum, not a sum."""

    def __add__(self, other: "_PieceSums") -> "_PieceSums":
        return _PieceSums(
            sums=RunSums.total([self.sums, other.sums]), moments=self.moments + other.moments,
            squared_steps=self.squared_steps + other.squared_steps,
            resting_steps=self.resting_steps + other.resting_steps, largest=np.maximum(self.largest, other.largest),
        )  # fmt: skip


def run_sums(
    trajectory: Trajectory, count: int, rate: float, body: Body, platform: Platform, taps: Sequence[Array],
    basis: WrenchBasis, delayed: bool,
) -> tuple[RunSums, RunMoments, Peaks]:  # fmt: skip
    """Sum over a run's samples: all that the law depends on, whatever the size of the errors.

    Args:
        trajectory: the motion.
        count: samples from 0 on.
        rate: at which they are taken [Hz].
        body: that is moved.
        platform: what carries it.
        taps: every estimator's differentiator.
        basis: the functions of time that the sources need.
        delayed: whether the sums' second order in a delay of the gyro is needed.
    """
    differentiators, still_body = [np.asarray(h) for h in taps], jax.tree.map(np.asarray, body)
    pieces = _pieces(trajectory, count, rate, platform, 3 * max(map(len, differentiators)), delayed)
    sums = reduce(add, (_summed(piece, count, still_body, basis, differentiators) for piece in pieces))
    steps = max(count - 1, 1)
    largest, moves, rests = (
        dict(zip(SIGNALS, x.reshape(3, 3), strict=True))
        for x in (sums.largest, np.sqrt(sums.squared_steps / steps), sums.resting_steps / steps)
    )
    return sums.sums, sums.moments, Peaks(largest=largest, moves=moves, rests=rests, rate=rate)


def _pieces(
    trajectory: Trajectory, count: int, rate: float, platform: Platform, margin: int, delayed: bool
) -> Iterator[_Piece]:
    """Yield a run's pieces, each of the same size."""
    start = jax.device_put(np.eye(3))
    for first in range(0, count, PIECE):
        numbers = first - margin + np.arange(PIECE + 2 * margin)
        t = np.clip(numbers, 0, count - 1) / rate  # before and after the run the body is at rest
        sampled, by_delay, start = _moved(start, jax.device_put(t), trajectory, platform, margin, delayed)
        yield _Piece(jax.tree.map(np.asarray, sampled), np.asarray(by_delay), numbers)


@partial(jax.jit, static_argnames=("margin", "delayed"))
def _moved(start, t, trajectory, platform, margin, delayed):
    """A piece's motion; omega's derivatives by a delay, if there is one; the attitude where the next piece starts.

    ``start`` is the attitude at the first sample.
    """
    still, gravity = platform.r_cg_from_still, platform.gravity
    motion = sample(trajectory, t, r_cg_from_still=still, gravity=gravity, start=start)
    if not delayed:
        return motion, jnp.zeros((0, *motion.omega.shape)), motion.rotation[PIECE]
    return motion, jnp.stack([-motion.alpha, jerk_of(trajectory, t)]), motion.rotation[PIECE]


@jax.jit
def jerk_of(trajectory: Trajectory, t: Float[Array, " n"]) -> Float[Array, "3 n"]:
    """Return the derivative of alpha of a trajectory at some instants, in B [rad/s³]."""
    return jax.vmap(lambda at: jax.jvp(trajectory.alpha, (at,), (jnp.ones_like(at),))[1], out_axes=1)(t)


def _summed(piece: _Piece, count: int, body: Body, basis: WrenchBasis, taps: Sequence[np.ndarray]) -> _PieceSums:
    motion, reach = piece.motion, max(map(len, taps))
    inner = slice(3 * reach, 3 * reach + PIECE)
    valid = ((piece.numbers >= reach) & (piece.numbers < count - reach)).astype(float)
    wrench = np.concatenate([basis.sampled(body, motion, 0.0), np.ones((1, len(motion.t)))])
    elements = [x[:, inner] * valid[inner] for x in _elements_by_delay(motion, piece.by_delay, taps)]
    gram, with_wrench = _gram_by_delay(*elements), np.array([phi @ wrench[:, inner].T for phi in elements])
    chosen = [np.r_[:15, 15 + 3 * e : 18 + 3 * e] for e in range(len(taps))]
    differentiable = slice(reach, -reach)
    omega = np.asarray(motion.omega)
    alphas = [padded_derivative(omega, h) for h in taps]
    signals = np.concatenate([omega, *alphas, wrench[:6]])[:, differentiable]
    sensed = np.concatenate([wrench[:6], motion.omega])[:, inner.start - 1 : inner.stop]
    inside = (piece.numbers >= 0) & (piece.numbers < count)
    both = inside[inner.start - 1 : inner.stop - 1] & inside[inner]
    steps = np.diff(sensed) * both
    largest = np.abs(sensed[:, 1:] * inside[inner]).max(axis=1)
    resting = np.abs(steps) <= REST * np.repeat(largest.reshape(3, 3).max(axis=1), 3)[:, None]
    return _PieceSums(
        sums=RunSums(
            np.stack([gram[:, k[:, None], k] for k in chosen], axis=1),
            np.stack([with_wrench[:, k] for k in chosen], axis=1),
        ),
        moments=run_moments(signals, valid[differentiable], taps, margin=2 * reach),
        squared_steps=(steps**2).sum(axis=1),
        resting_steps=(resting & both).sum(axis=1).astype(float),
        largest=largest,
    )


def _elements_by_delay(motion: Motion, by_delay: np.ndarray, taps: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the coefficients of the elements' Taylor series in a delay, the second order if there is one.

    With ``ω(t - τ) = ω - α τ + ½ ω″ τ²``. The elements are quadratic in omega, so that differences over steps of any
    size are exact.
    """
    at = lambda change: _elements(motion.omega + change, motion.t, taps)  # noqa: E731
    now = at(0.0)
    if not len(by_delay):
        return [now]
    # f(ω + d) - f(ω - d) and f(ω + d) - 2 f(ω) + f(ω - d): a quadratic's slope and curvature, without an error of
    # truncation
    (more, less), (later, earlier) = ((at(change), at(-change)) for change in by_delay)
    return [now, (more - less) / 2, (more - 2 * now + less + (later - earlier) / 2) / 2]


def _gram_by_delay(now: np.ndarray, *higher: np.ndarray) -> Float[np.ndarray, "orders elements elements"]:
    """Return the coefficients of the Gram matrix's Taylor series from those of the elements."""
    if not higher:
        return (now @ now.T)[None]
    first, second = higher
    # coefficients of a product of series (Cauchy): S₁ = f₁ f₀ᵀ + f₀ f₁ᵀ, S₂ = f₂ f₀ᵀ + f₀ f₂ᵀ + f₁ f₁ᵀ
    slope, curvature = first @ now.T, second @ now.T
    return np.array([now @ now.T, slope + slope.T, curvature + curvature.T + first @ first.T])


def _elements(omega: np.ndarray, t: Array, taps: Sequence[np.ndarray]) -> Float[np.ndarray, "elements n"]:
    """Return the elements that :mod:`uq.monte_carlo.gram_sums.case_equations` maps, every estimator's alpha last."""
    alphas = [padded_derivative(omega, h) for h in taps]
    return np.concatenate([true_elements(omega, alphas[0], t), *alphas])
