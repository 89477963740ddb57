"""One trial of the Monte Carlo: draws in, estimates of every case and estimator out. A pure function of a key.

A trial visits its samples in blocks and keeps only sums (:mod:`identify.gram`): the noise-free sums are known, and what
the gyro's noise changes in the features is summed apart from them. Every case (all sources, one group, one source) and
every estimator is solved from the sums of the same draws, over the samples where all estimators have a derivative.

White normal noise of the load cell enters through sums that are linear in it, so that, given the gyro's draws, these
sums are normal with a known covariance. ``sampling="conditioned"`` draws them from it; ``"samples"`` draws the noise of
every sample. Both have the same distribution.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from identify.differentiate import derivative
from identify.dynamics import wrench
from identify.gram import Sums, solve, sums_of, with_offsets
from identify.inertia import Body
from identify.regressor import ALPHA, features
from identify.trajectory import Motion
from uq.sources import BLOCK, Source, draw_bias, draw_block, draw_sums

Sampling = Literal["conditioned", "samples"]

SHARED = ALPHA.start
"""Features that all estimators share: all but alpha."""


class Estimator(eqx.Module):
    """A way from recorded signals to the tensor: ordinary least squares with a differentiator."""

    name: str = eqx.field(static=True)
    taps: Float[Array, " h"]
    """Taps of the differentiator [1/s]; see :mod:`identify.differentiate`."""


class Case(NamedTuple):
    """A set of sources that act together while the others are off."""

    name: str
    sources: frozenset[str]


class Signals(NamedTuple):
    """The noise-free run in blocks, block first (without that axis inside the scan)."""

    block: Int[Array, "*blocks"]
    """Number of the block."""
    features: Float[Array, "*blocks features 4000"]
    """The shared features, then each estimator's alpha; zero where a sample does not count."""
    wrench: Float[Array, "*blocks 6 4000"]
    """Force [N] and moment [N·m]."""
    valid: Float[Array, "*blocks 4000"]
    """1 where every estimator has a derivative, else 0."""


class Setup(eqx.Module):
    """Everything that a trial needs besides its key: one trajectory, one body, its sources and estimators."""

    body: Body
    signals: Signals
    sums: Sums
    """Noise-free sums over all features."""
    sources: tuple[Source, ...]
    estimators: tuple[Estimator, ...]
    cases: tuple[Case, ...] = eqx.field(static=True)
    dtype: np.dtype = eqx.field(static=True)
    """Precision of draws and features; sums and solutions have the default precision."""
    sampling: Sampling = eqx.field(static=True)


class TrialEstimates(NamedTuple):
    """Estimates of one trial."""

    inertia: Float[Array, "estimators cases 6"]
    """Packed tensors [kg·m²]; NaN where a case could not be solved."""
    ok: Bool[Array, "estimators cases"]
    """Which could."""


def cases_of(sources: Sequence[Source]) -> tuple[Case, ...]:
    """Return the cases of the breakdown: all sources, each group, each source."""
    groups = dict.fromkeys(source.group for source in sources)
    return (
        Case("total", frozenset(source.name for source in sources)),
        *(Case(f"group:{name}", frozenset(s.name for s in sources if s.group == name)) for name in groups),
        *(Case(f"source:{source.name}", frozenset([source.name])) for source in sources),
    )


def prepare(
    motion: Motion,
    body: Body,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
) -> Setup:
    """Cut a noise-free motion and its wrench into blocks, with the noise-free sums of every estimator."""
    true = jax.vmap(wrench, in_axes=(None, 1, 1, 1), out_axes=1)(
        body, motion.omega, motion.alpha, motion.specific_force_cg
    )
    n, halo = len(motion.t), _halo(estimators)
    index = jnp.arange(n)
    valid = ((index >= halo) & (index < n - halo)).astype(float)
    alphas = [jnp.pad(derivative(motion.omega, e.taps), ((0, 0), (e.taps.shape[0],) * 2)) for e in estimators]
    phi = jnp.concatenate([features(motion.omega, motion.alpha)[:SHARED], *alphas]) * valid[None]
    both = jnp.concatenate(true)
    sums = sums_of(phi, both[:3], both[3:])
    count = -(-n // BLOCK)
    signals = Signals(
        jnp.arange(count),
        _blocks(phi.astype(dtype)),
        _blocks(both.astype(dtype)),
        _blocks(valid[None].astype(dtype))[:, 0],
    )
    return Setup(body, signals, sums, tuple(sources), tuple(estimators), cases_of(sources), np.dtype(dtype), sampling)


def _halo(estimators: Sequence[Estimator]) -> int:
    """Samples that the longest differentiator needs on either side."""
    return max(estimator.taps.shape[0] for estimator in estimators)


def _blocks(signal: Array) -> Array:
    """Cut component-first samples into zero-padded blocks, block first."""
    count = -(-signal.shape[1] // BLOCK)
    padded = jnp.pad(signal, ((0, 0), (0, count * BLOCK - signal.shape[1])))
    return padded.reshape(signal.shape[0], count, BLOCK).swapaxes(0, 1)


def trial(setup: Setup, key: Key[Array, ""], index: Int[Array, ""]) -> TrialEstimates:
    """Run one trial.

    Args:
        setup: the experiment on one trajectory.
        key: the campaign's key, from its seed.
        index: number of the trial.

    Returns:
        The estimates of every estimator and case, from the same draws.
    """
    plan = _plan(setup)
    biases = {s.name: draw_bias(s, key, index, setup.dtype).astype(float) for s in setup.sources if s.kind == "bias"}
    drawn = _visit_blocks(setup, plan, key, index)
    cell = _conditioned(setup, plan, drawn, key, index) if setup.sampling == "conditioned" else drawn.cell
    sums, r_cg = _problems(setup, plan, biases, drawn, cell)
    estimate = jax.vmap(jax.vmap(solve), in_axes=(0, None))(sums, r_cg)
    return TrialEstimates(estimate.inertia, estimate.ok)


class _Plan(NamedTuple):
    """Which draws a setup needs, found from its static part."""

    gyro: tuple[Source, ...]
    """Precision sources of omega."""
    cell: tuple[Source, ...]
    """Precision sources of force and moment."""
    variants: tuple[frozenset[str], ...]
    """The sets of gyro sources that act together in some case; not the empty one."""


def _plan(setup: Setup) -> _Plan:
    precision = [source for source in setup.sources if source.kind == "precision"]
    gyro = tuple(source for source in precision if source.target == "omega")
    cell = tuple(source for source in precision if source.target in ("F", "M"))
    names = frozenset(source.name for source in gyro)
    variants = dict.fromkeys(active for case in setup.cases if (active := case.sources & names))
    return _Plan(gyro, cell, tuple(variants))


class _Drawn(NamedTuple):
    """Sums over one trial. A change is what a variant's gyro noise adds to a feature; variant by variant."""

    with_true: Float[Array, "changes features"]
    """Of the changes with the true features."""
    with_changes: Float[Array, "changes changes"]
    """Of the changes with each other."""
    with_wrench: Float[Array, "changes 6"]
    """Of the changes with the true wrench."""
    cell: Float[Array, "all columns"]
    """Of true features and changes with the load cell's noise, three columns a source; none when conditioned."""


def _visit_blocks(setup: Setup, plan: _Plan, key, index) -> _Drawn:
    """Scan over the blocks, drawing gyro noise one block ahead so that the differentiators see across the seams."""
    halo = _halo(setup.estimators)

    def gyro(block):
        return [draw_block(source, key, index, block, setup.dtype) for source in plan.gyro]

    def visit(carry, signals):
        before, now, sums = carry
        after = gyro(signals.block + 1)
        sums = _add(sums, block_sums(before, now, after, signals))
        return ([noise[:, -halo:] for noise in now], after, sums), None

    def block_sums(before, now, after, signals):
        wide = [jnp.concatenate([a, b, c[:, :halo]], axis=1) for a, b, c in zip(before, now, after, strict=True)]
        drawn = plan.cell if setup.sampling == "samples" else ()
        cell = [draw_block(source, key, index, signals.block, setup.dtype) for source in drawn]
        noise = jnp.concatenate([jnp.zeros((0, BLOCK), setup.dtype), *cell])
        return _block_sums(setup.estimators, plan, signals, wide, noise)

    head, last = jax.tree.map(lambda x: x[:-1], setup.signals), jax.tree.map(lambda x: x[-1], setup.signals)
    edge = [jnp.zeros((3, halo), setup.dtype) for _ in plan.gyro]
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), jax.eval_shape(block_sums, edge, gyro(0), edge, last))
    (before, now, sums), _ = jax.lax.scan(visit, (edge, gyro(0), zero), head)
    return _add(sums, block_sums(before, now, edge, last))


def _block_sums(estimators, plan: _Plan, signals: Signals, wide, cell) -> _Drawn:
    """Sums of one block: ``wide`` holds each gyro source's noise with a halo on either side, ``cell`` the wrench's."""
    true = signals.features
    halo, taps = _halo(estimators), [e.taps.astype(true.dtype) for e in estimators]
    changes = [jnp.zeros((0, BLOCK), true.dtype)]
    for variant in plan.variants:
        noise = sum(w for w, source in zip(wide, plan.gyro, strict=True) if source.name in variant)
        changes.append(_changes(true[1:4], noise, halo, taps) * signals.valid[None])
    change = jnp.concatenate(changes)
    everything = change @ jnp.concatenate([true, change, signals.wrench, cell]).T
    with_true, with_changes, with_wrench, with_cell = jnp.split(
        everything, np.cumsum([len(true), len(change), len(signals.wrench)]), axis=1
    )
    return _Drawn(with_true, with_changes, with_wrench, jnp.concatenate([true @ cell.T, with_cell]))


def _changes(omega, noise, halo: int, taps) -> Array:
    """What noise in omega (3, halo + block + halo) adds to each feature but 1."""
    inner = noise[:, halo : halo + BLOCK]
    (w1, w2, _), (e1, e2, e3) = omega, inner
    _, noisy2, noisy3 = omega + inner
    squares = (2 * omega + inner) * inner
    crossed = jnp.stack([w1 * e2 + e1 * noisy2, w1 * e3 + e1 * noisy3, w2 * e3 + e2 * noisy3])
    alphas = [derivative(noise[:, halo - len(t) : halo + BLOCK + len(t)], t) for t in taps]
    return jnp.concatenate([inner, squares, crossed, *alphas])


def _add(sums, more):
    return jax.tree.map(lambda total, part: total + part.astype(total.dtype), sums, more)


def _conditioned(setup: Setup, plan: _Plan, drawn: _Drawn, key, index) -> Float[Array, "all columns"]:
    """Draw the sums of features and changes with the load cell's noise, given these features and changes."""
    gram = jnp.block([[setup.sums.gram, drawn.with_true.T], [drawn.with_true, drawn.with_changes]])
    scale = jnp.sqrt(jnp.diag(gram))
    inverse = jnp.where(scale > 0, 1 / jnp.where(scale > 0, scale, 1), 0)
    nearly_singular = max(1e-12, 64 * len(gram) * float(jnp.finfo(gram.dtype).eps))  # alphas of alike differentiators
    correlation = gram * jnp.outer(inverse, inverse) + nearly_singular * jnp.eye(len(gram))
    root = scale[:, None] * jnp.linalg.cholesky(correlation)
    columns = [root @ draw_sums(source, key, index, len(gram)) for source in plan.cell]
    return jnp.concatenate([jnp.zeros((len(gram), 0)), *columns], axis=1)


def _problems(setup: Setup, plan: _Plan, biases, drawn: _Drawn, cell) -> tuple[Sums, Array]:
    """The sums, (estimators, cases, …), and the believed centre of gravity, (cases, 3)."""
    of_cases, size, width = setup.cases, len(setup.sums.gram), len(plan.cell)
    gyro = frozenset(source.name for source in plan.gyro)
    variant = np.array([[frozenset(), *plan.variants].index(case.sources & gyro) for case in of_cases])
    gram, both, noise = (part[variant] for part in _variant_sums(setup.sums, plan, drawn, cell))
    on = [[[float(s.name in c.sources and s.target == t) for t in "FM"] for s in plan.cell] for c in of_cases]
    noise = noise.reshape(len(of_cases), size, width, 3)
    added = jnp.einsum("cskj,ckt->cstj", noise, np.reshape(on, (len(of_cases), width, 2)))
    both = both + added.reshape(both.shape)

    def offset(target):
        names = [s.name for s in setup.sources if s.kind == "bias" and s.target == target]
        mask = np.array([[float(name in c.sources) for name in names] for c in of_cases]).reshape(
            len(of_cases), len(names)
        )
        return mask @ jnp.stack([biases[name] for name in names]) if names else jnp.zeros((len(of_cases), 3))

    shifted = []
    for k in range(len(setup.estimators)):
        own = np.r_[0:SHARED, SHARED + 3 * k : SHARED + 3 * k + 3]
        sums = Sums(gram[:, own][:, :, own], both[:, own, :3], both[:, own, 3:])
        shifted.append(jax.vmap(with_offsets)(sums, offset("omega"), offset("F"), offset("M")))
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *shifted), setup.body.r_cg_from_q[None] + offset("r_cg")


def _variant_sums(true: Sums, plan: _Plan, drawn: _Drawn, cell) -> tuple[Array, Array, Array]:
    """Gram matrix, sums with the true wrench and sums with the cell's noise; without gyro noise, then each variant."""
    size = len(true.gram)
    both = jnp.concatenate([true.force, true.moment], axis=1)
    grams, wrenches, noises = [true.gram], [both], [cell[:size]]
    for k in range(len(plan.variants)):
        part = slice(k * (size - 1), (k + 1) * (size - 1))
        linear = jnp.zeros((size, size)).at[1:].set(drawn.with_true[part])
        grams.append((true.gram + linear + linear.T).at[1:, 1:].add(drawn.with_changes[part, part]))
        wrenches.append(both.at[1:].add(drawn.with_wrench[part]))
        noises.append(cell[:size].at[1:].add(cell[size:][part]))
    return jnp.stack(grams), jnp.stack(wrenches), jnp.stack(noises)
