"""One trial of the Monte Carlo: draws in, estimates of every case and estimator out. A pure function of a key.

A trial visits its samples in blocks and keeps only sums (:mod:`identify.gram`). Every case (all sources, one group, one
source) and every estimator is solved from the sums of the same draws.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from identify.differentiate import derivative
from identify.dynamics import wrench
from identify.gram import Sums, accumulate, solve, with_offsets
from identify.inertia import Body
from identify.regressor import features
from identify.trajectory import Motion
from uq.sources import BLOCK, Source, draw_bias, draw_block


class Estimator(eqx.Module):
    """A way from recorded signals to the tensor: ordinary least squares with a differentiator."""

    name: str = eqx.field(static=True)
    taps: Float[Array, " h"]
    """Taps of the differentiator [1/s]; see :mod:`identify.differentiate`."""


class Case(NamedTuple):
    """A set of sources that act together while the others are off."""

    name: str
    sources: frozenset[str]


class Truth(eqx.Module):
    """What one estimator would see without errors, cut into blocks."""

    alpha: Float[Array, "blocks 3 4000"]
    """The differentiator's answer to the true omega [rad/s²]."""
    valid: Bool[Array, "blocks 4000"]
    """Which samples have a derivative, and so a row in the regressor."""
    sums: Sums
    """Sums of the noise-free run."""


class Setup(eqx.Module):
    """Everything that a trial needs besides its key: one trajectory, one body, its sources and estimators."""

    body: Body
    omega: Float[Array, "blocks 3 4000"]
    force: Float[Array, "blocks 3 4000"]
    moment: Float[Array, "blocks 3 4000"]
    truths: tuple[Truth, ...]
    sources: tuple[Source, ...]
    estimators: tuple[Estimator, ...]
    cases: tuple[Case, ...] = eqx.field(static=True)
    dtype: jnp.dtype = eqx.field(static=True)
    """Precision of the draws and of the features; sums and solutions have the default precision."""

    @property
    def halo(self) -> int:
        """Samples that the longest differentiator needs on either side of a block."""
        return max(estimator.taps.shape[0] for estimator in self.estimators)


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
    motion: Motion, body: Body, sources: Sequence[Source], estimators: Sequence[Estimator], dtype: jnp.dtype
) -> Setup:
    """Cut a noise-free motion and its wrench into blocks, with each estimator's noise-free sums."""
    columns = (None, 1, 1, 1)
    force, moment = jax.vmap(wrench, in_axes=columns, out_axes=1)(
        body, motion.omega, motion.alpha, motion.specific_force_cg
    )
    truths = [_truth(motion.omega, force, moment, estimator.taps, dtype) for estimator in estimators]
    blocks = [_blocks(signal.astype(dtype)) for signal in (motion.omega, force, moment)]
    return Setup(body, *blocks, tuple(truths), tuple(sources), tuple(estimators), cases_of(sources), np.dtype(dtype))


def _truth(omega, force, moment, taps, dtype) -> Truth:
    h = taps.shape[0]
    alpha = derivative(omega, taps)
    inner = slice(h, omega.shape[1] - h)
    sums = accumulate(omega[:, inner], alpha, force[:, inner], moment[:, inner])
    padded = jnp.pad(alpha, ((0, 0), (h, h)))
    index = jnp.arange(omega.shape[1])
    valid = (index >= h) & (index < omega.shape[1] - h)
    return Truth(_blocks(padded.astype(dtype)), _blocks(valid[None])[:, 0], sums)


def _blocks(signal: Array) -> Array:
    """Cut component-first samples into zero-padded blocks, block first."""
    count = -(-signal.shape[1] // BLOCK)
    padded = jnp.pad(signal, ((0, 0), (0, count * BLOCK - signal.shape[1])))
    return padded.reshape(signal.shape[0], count, BLOCK).swapaxes(0, 1)


class _Plan(NamedTuple):
    """Which draws a setup needs, found from its static part."""

    gyro: tuple[Source, ...]
    """Precision sources of omega."""
    cell: tuple[Source, ...]
    """Precision sources of force and moment."""
    variants: tuple[frozenset[str], ...]
    """The sets of gyro sources that act together in some case; the first is empty."""


def _plan(setup: Setup) -> _Plan:
    precision = [source for source in setup.sources if source.kind == "precision"]
    gyro = tuple(source for source in precision if source.target == "omega")
    cell = tuple(source for source in precision if source.target in ("F", "M"))
    names = frozenset(source.name for source in gyro)
    return _Plan(gyro, cell, tuple(dict.fromkeys([frozenset[str](), *(case.sources & names for case in setup.cases)])))


class _Drawn(NamedTuple):
    """Sums of one estimator in one trial."""

    true: tuple[Sums, ...]
    """Of the noisy features with the true wrench, one for each variant but the first."""
    cell: tuple[Float[Array, "13 columns"], ...]
    """Of the features with the load cell's noise, three columns a source, one for each variant."""


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
    problems = [
        _problem(setup, plan, biases, truth.sums, of_estimator, case)
        for truth, of_estimator in zip(setup.truths, drawn, strict=True)
        for case in setup.cases
    ]
    estimate = jax.vmap(solve)(*jax.tree.map(lambda *leaves: jnp.stack(leaves), *problems))
    shape = (len(setup.estimators), len(setup.cases))
    return TrialEstimates(estimate.inertia.reshape(*shape, 6), estimate.ok.reshape(shape))


def _problem(setup, plan, biases, true, drawn, case) -> tuple[Sums, Float[Array, "3"]]:
    """The sums and the believed centre of gravity of one case."""

    def offset(target):
        active = [biases[s.name] for s in setup.sources if s.name in biases and s.name in case.sources and s.target == target]
        return sum(active, start=jnp.zeros(3))

    variant = plan.variants.index(case.sources & frozenset(source.name for source in plan.gyro))
    sums = true if variant == 0 else drawn.true[variant - 1]
    for column, source in enumerate(plan.cell):
        if source.name in case.sources:
            noise = drawn.cell[variant][:, 3 * column : 3 * column + 3]
            if source.target == "F":
                sums = sums._replace(force=sums.force + noise)
            else:
                sums = sums._replace(moment=sums.moment + noise)
    return with_offsets(sums, offset("omega"), offset("F"), offset("M")), setup.body.r_cg_from_q + offset("r_cg")


def _visit_blocks(setup: Setup, plan: _Plan, key, index) -> list[_Drawn]:
    """Scan over the blocks, drawing gyro noise one block ahead so that the differentiators see across the seams."""
    halo, count = setup.halo, setup.omega.shape[0]

    def gyro(block):
        return [draw_block(source, key, index, block, setup.dtype) for source in plan.gyro]

    def visit(carry, truth):
        before, now, sums = carry
        after = gyro(truth.block + 1)
        sums = _add(sums, block_sums(before, now, after, truth))
        return ([noise[:, -halo:] for noise in now], after, sums), None

    def block_sums(before, now, after, truth):
        wide = [jnp.concatenate([a, b, c[:, :halo]], axis=1) for a, b, c in zip(before, now, after, strict=True)]
        cell = [draw_block(source, key, index, truth.block, setup.dtype) for source in plan.cell]
        return _block_sums(setup.estimators, plan, truth, wide, cell)

    blocks = _Block(
        jnp.arange(count),
        setup.omega,
        jnp.concatenate([setup.force, setup.moment], axis=1),
        tuple(truth.alpha for truth in setup.truths),
        tuple(truth.valid for truth in setup.truths),
    )
    head, last = jax.tree.map(lambda x: x[:-1], blocks), jax.tree.map(lambda x: x[-1], blocks)
    edge = [jnp.zeros((3, halo), setup.dtype) for _ in plan.gyro]
    shapes = jax.eval_shape(block_sums, edge, gyro(0), edge, last)
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), shapes)
    (before, now, sums), _ = jax.lax.scan(visit, (edge, gyro(0), zero), head)
    return _add(sums, block_sums(before, now, edge, last))


class _Block(NamedTuple):
    """The noise-free signals of one block (of all, before the scan)."""

    block: Array
    omega: Array
    wrench: Array
    alpha: tuple[Array, ...]
    valid: tuple[Array, ...]


def _block_sums(estimators, plan, truth, wide, cell) -> list[_Drawn]:
    """Sums of one block: ``wide`` holds each gyro source's noise with a halo on either side, ``cell`` the wrench's."""
    noise = jnp.concatenate(cell) if cell else jnp.zeros((0, BLOCK), truth.omega.dtype)
    halo = (wide[0].shape[1] - BLOCK) // 2 if wide else 0
    result = []
    for estimator, alpha, valid in zip(estimators, truth.alpha, truth.valid, strict=True):
        h = estimator.taps.shape[0]
        taps = estimator.taps.astype(truth.omega.dtype)
        true, with_noise = [], []
        for variant in plan.variants:
            active = [w for w, source in zip(wide, plan.gyro, strict=True) if source.name in variant]
            omega_v, alpha_v = truth.omega, alpha
            for w in active:
                omega_v = omega_v + w[:, halo : halo + BLOCK]
                alpha_v = alpha_v + derivative(w[:, halo - h : halo + BLOCK + h], taps)
            phi = jnp.where(valid, features(omega_v, alpha_v), 0)
            if variant:
                product = phi @ jnp.concatenate([phi, truth.wrench, noise]).T
                n = len(phi)
                true.append(Sums(product[:, :n], product[:, n : n + 3], product[:, n + 3 : n + 6]))
                with_noise.append(product[:, n + 6 :])
            else:
                with_noise.append(phi @ noise.T)
        result.append(_Drawn(tuple(true), tuple(with_noise)))
    return result


def _add(sums, more):
    return jax.tree.map(lambda total, part: total + part.astype(total.dtype), sums, more)
