"""One trial of the Monte Carlo: draws in, estimates of every case and estimator out. A pure function of a key.

A trial visits its samples in blocks and keeps only sums (:mod:`identify.gram`): the noise-free sums are known, and what
the gyro's noise changes in the features is summed apart from them. Every case (all sources, one group, one source) and
every estimator is solved from the sums of the same draws, over the samples where all estimators have a derivative.
Constant errors are linear maps of these sums (:mod:`uq.measurement`).

White normal noise of the load cell enters through sums that are linear in it, so that, given the gyro's draws, these
sums are normal with a known covariance. ``sampling="conditioned"`` draws them from it; ``"samples"`` draws the noise of
every sample. Both have the same distribution. Noise of other distributions is always drawn sample by sample.

``sampling="collapsed"`` draws the gyro's sums, too: :mod:`uq.collapsed`.

Sources that no sums can tell (delay, saturation, quantisation, coloured noise) need every sample: :mod:`uq.sampled`.
"""

from collections.abc import Sequence
from functools import partial
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from identify.differentiate import derivative
from identify.gram import Sums, solve
from identify.inertia import Body
from identify.regressor import ALPHA, features
from identify.trajectory import Motion
from uq.distributions import Normal
from uq.errors import Errors, errors_of_cases, perturbed
from uq.measurement import OF_THE_GYRO, Columns, Platform, element_map, noisy_elements, true_elements
from uq.normals import in_order, joined
from uq.sources import BLOCK, Mixing, Source, draw_blocks, draw_constants, draw_pairs, draw_sums

Sampling = Literal["conditioned", "samples", "collapsed"]

PAIRS = ((0, 1), (0, 2), (1, 2))
"""Axes of the features that are products of two."""
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
    features: Float[Array, "*blocks features 1200"]
    """What the estimators share, then each one's alpha; zero where a sample does not count. Shared are the features, or
    with errors that map the angular velocity the elements of :func:`uq.measurement.true_elements`."""
    wrench: Float[Array, "*blocks columns 1200"]
    """Force [N] and moment [N·m], then the other functions of :class:`uq.measurement.Columns`."""
    known: Float[Array, "*blocks 1200 padded"]
    """Both again, sample by sample, filled up to the width of a processor's matrix product."""
    valid: Float[Array, "*blocks 1200"]
    """1 where every estimator has a derivative, else 0."""


class Setup(eqx.Module):
    """Everything that a trial needs besides its key: one trajectory, one body, its sources and estimators."""

    body: Body
    platform: Platform
    signals: Signals
    sums: Sums
    """Noise-free sums over all features."""
    other: Float[Array, "features other"]
    """Sums of the features with the columns that follow the wrench."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    estimators: tuple[Estimator, ...]
    cases: tuple[Case, ...] = eqx.field(static=True)
    columns: Columns = eqx.field(static=True)
    whole: bool = eqx.field(static=True)
    """Whether errors map the angular velocity, so that sums of whole products with the noise are kept."""
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
    platform: Platform,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    mixing: Sequence[Mixing] = (),
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
) -> Setup:
    """Cut a noise-free motion and its wrench into blocks, with the noise-free sums of every estimator."""
    columns = Columns.of(sources)
    whole = bool(perturbed(sources) & OF_THE_GYRO)
    t = motion.t - motion.t[0]
    shared = true_elements(motion.omega, motion.alpha, t) if whole else features(motion.omega, motion.alpha)[:SHARED]
    valid = valid_samples(len(t), estimators)
    alphas = [jnp.pad(derivative(motion.omega, e.taps), ((0, 0), (e.taps.shape[0],) * 2)) for e in estimators]
    phi = jnp.concatenate([shared, *alphas]) * valid[None]
    wrench = columns.sampled(body, motion)
    force, moment, other = jnp.split(phi @ wrench.T, (3, 6), axis=1)
    signals = Signals(
        jnp.arange(-(-len(t) // BLOCK)),
        _blocks(phi.astype(dtype)),
        _blocks(wrench.astype(dtype)),
        _blocks(_padded(jnp.concatenate([phi, wrench]).astype(dtype))).swapaxes(1, 2),
        _blocks(valid[None].astype(dtype))[:, 0],
    )
    return Setup(
        body, platform, signals, Sums(phi @ phi.T, force, moment), other, tuple(sources), tuple(mixing),
        tuple(estimators), cases_of(sources), columns, whole, np.dtype(dtype), sampling,
    )  # fmt: skip


def valid_samples(n: int, estimators: Sequence[Estimator]) -> Float[Array, " n"]:
    """Return 1 where every estimator has a derivative, else 0."""
    index, halo = jnp.arange(n), _halo(estimators)
    return ((index >= halo) & (index < n - halo)).astype(float)


def _halo(estimators: Sequence[Estimator]) -> int:
    """Samples that the longest differentiator needs on either side."""
    return max(estimator.taps.shape[0] for estimator in estimators)


def _blocks(signal: Array) -> Array:
    """Cut component-first samples into zero-padded blocks, block first."""
    count = -(-signal.shape[1] // BLOCK)
    padded = jnp.pad(signal, ((0, 0), (0, count * BLOCK - signal.shape[1])))
    return padded.reshape(signal.shape[0], count, BLOCK).swapaxes(0, 1)


def _padded(rows: Array) -> Array:
    """Fill up with zeros to a multiple of 16 rows."""
    return jnp.pad(rows, ((0, -len(rows) % 16), (0, 0)))


def trial(setup: Setup, key: Key[Array, ""], index: Int[Array, ""]) -> TrialEstimates:
    """Run one trial.

    Args:
        setup: the experiment on one trajectory.
        key: the campaign's key, from its seed.
        index: number of the trial.

    Returns:
        The estimates of every estimator and case, from the same draws.
    """
    return jax.tree.map(lambda leaf: leaf[0], trials(setup, key, jnp.asarray(index)[None]))


def trials(
    setup: Setup, key: Key[Array, ""], indices: Int[Array, " trials"], *, at_once: bool = False
) -> TrialEstimates:
    """Run several trials block by block, so that a block of the true run is fetched once for all of them.

    Args:
        setup: the experiment on one trajectory.
        key: the campaign's key, from its seed.
        indices: numbers of the trials.
        at_once: whether to visit a block for all trials at a time, which wide devices need; else one by one, so that
            what a trial works on stays in a processor's cache.

    Returns:
        The estimates, with the trials on the leading axis.
    """
    plan = _plan(setup)
    drawn = _visit_blocks(setup, plan, key, indices, jax.vmap if at_once else _mapped)

    def solved(index, drawn):
        draws = draw_constants(setup.sources, setup.mixing, key, index, setup.dtype)
        errors = errors_of_cases(setup.sources, draws, [case.sources for case in setup.cases])
        sums, r_cg = _problems(setup, plan, errors, _all_sums(setup, plan, drawn, key, index))
        estimate = jax.vmap(jax.vmap(solve), in_axes=(0, None))(sums, r_cg)
        return TrialEstimates(estimate.inertia, estimate.ok)

    return jax.vmap(solved)(indices, drawn)


def _mapped(function):
    return lambda *of_trials: jax.lax.map(lambda one: function(*one), of_trials)


class _Plan(NamedTuple):
    """Which draws a setup needs, found from its static part."""

    gyro: tuple[Source, ...]
    """Precision sources of omega."""
    sampled: tuple[Source, ...]
    """Precision sources of force and moment that are drawn sample by sample."""
    conditioned: tuple[Source, ...]
    """Those whose sums are drawn."""
    variants: tuple[frozenset[str], ...]
    """The sets of gyro sources that act together in some case; not the empty one."""


def _plan(setup: Setup) -> _Plan:
    precision = [source for source in setup.sources if source.kind == "precision"]
    gyro = tuple(source for source in precision if source.target == "omega")
    cell = [source for source in precision if source.target in ("F", "M")]
    in_sums = [setup.sampling == "conditioned" and isinstance(source.shape, Normal) for source in cell]
    names = frozenset(source.name for source in gyro)
    variants = dict.fromkeys(active for case in setup.cases if (active := case.sources & names))
    sampled, conditioned = (
        tuple(s for s, drawn in zip(cell, in_sums, strict=True) if drawn is which) for which in (False, True)
    )
    return _Plan(gyro, sampled, conditioned, tuple(variants))


class _Drawn(NamedTuple):
    """Sums over one trial. A change is what a variant's gyro noise adds to a feature; variant by variant."""

    with_true: Float[Array, "changes features"]
    """Of the changes with the true features."""
    with_changes: Float[Array, "changes changes"]
    """Of the changes with each other."""
    with_wrench: Float[Array, "changes columns"]
    """Of the changes with the true wrench and the columns that follow it."""
    cell: Float[Array, "all noise"]
    """Of true features and changes with the load cell's noise that is drawn by sample, three columns a source."""


def _visit_blocks(setup: Setup, plan: _Plan, key, indices, over_trials) -> _Drawn:
    """Scan over the blocks, drawing gyro noise one block ahead so that the differentiators see across the seams."""
    halo = _halo(setup.estimators)

    def draw(index, block, first=BLOCK // 2):
        return draw_pairs(plan.gyro, setup.mixing, key, index, block, setup.dtype, first=first)

    def of_trial(signals, index, before, now):
        after = draw(index, signals.block + 1)
        # drawn again: what is carried to the next block, and nothing else, lets the compiler draw in one loop
        heads = draw(index, signals.block + 1, halo) if halo <= BLOCK // 2 else after
        wide = [joined([a, b.real, b.imag, in_order(c)[:, :halo]]) for a, b, c in zip(before, now, heads, strict=True)]
        cell = draw_blocks(plan.sampled, setup.mixing, key, index, signals.block, setup.dtype)
        sums = _block_sums(setup, plan, signals, wide, jnp.concatenate([jnp.zeros((0, BLOCK), setup.dtype), *cell]))
        return [in_order(pairs)[:, -halo:] for pairs in now], after, sums

    def visit(carry, signals):
        before, now, sums = carry
        before, now, more = over_trials(partial(of_trial, signals))(indices, before, now)
        return (before, now, _add(sums, more)), None

    edge = [jnp.zeros((len(indices), 3, halo), setup.dtype) for _ in plan.gyro]
    first = over_trials(lambda index: draw(index, 0))(indices)
    one = jax.tree.map(lambda leaf: leaf[0], setup.signals)
    sums = jax.eval_shape(over_trials(partial(of_trial, one)), indices, edge, first)[2]
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), sums)
    return jax.lax.scan(visit, (edge, first, zero), setup.signals)[0][2]


def _block_sums(setup: Setup, plan: _Plan, signals: Signals, wide, cell) -> _Drawn:
    """Sums of one block: ``wide`` holds each gyro source's noise with a halo on either side, ``cell`` the wrench's."""
    features = signals.features
    changes = [jnp.zeros((0, BLOCK), features.dtype)]
    for variant in plan.variants:
        noise = sum(w for w, source in zip(wide, plan.gyro, strict=True) if source.name in variant)
        changes += _changes(setup, features, noise)
    change = joined([one * signals.valid[None] for one in changes], axis=0)
    with_true, with_wrench, _ = jnp.split(
        change @ signals.known, np.cumsum([len(features), len(signals.wrench)]), axis=1
    )
    with_cell = jnp.concatenate([features @ cell.T, change @ cell.T])
    return _Drawn(with_true, change @ change.T, with_wrench, with_cell)


def _changes(setup: Setup, true, noise) -> list[Array]:
    """What noise in omega (3, halo + block + halo) adds to each feature but 1; or the noisy elements."""
    halo, omega = _halo(setup.estimators), true[1:4]
    inner = noise[:, halo : halo + BLOCK]
    taps = [estimator.taps.astype(noise.dtype) for estimator in setup.estimators]
    alphas = [derivative(noise[:, halo - len(t) : halo + BLOCK + len(t)], t) for t in taps]
    if setup.whole:
        return [noisy_elements(omega, true[SHARED], inner), *alphas]
    squares = (2 * omega + inner) * inner
    crossed = [omega[i : i + 1] * inner[j : j + 1] + inner[i : i + 1] * (omega + inner)[j : j + 1] for i, j in PAIRS]
    return [inner, squares, *crossed, *alphas]


def _add(sums, more):
    return jax.tree.map(lambda total, part: total + part.astype(total.dtype), sums, more)


class _AllSums(NamedTuple):
    """Sums over true features and changes alike."""

    gram: Float[Array, "all all"]
    wrench: Float[Array, "all columns"]
    noise: Float[Array, "all sources 3"]
    """With the load cell's noise, first of the sources drawn by sample, then of those whose sums are drawn."""


def _all_sums(setup: Setup, plan: _Plan, drawn: _Drawn, key, index) -> _AllSums:
    gram = jnp.block([[setup.sums.gram, drawn.with_true.T], [drawn.with_true, drawn.with_changes]])
    true = jnp.concatenate([setup.sums.force, setup.sums.moment, setup.other], axis=1)
    conditioned = jnp.zeros((len(gram), 0))
    if plan.conditioned:
        root = _root(gram)
        draws = draw_sums(plan.conditioned, setup.mixing, key, index, len(gram))
        conditioned = jnp.concatenate([root @ one for one in draws], axis=1)
    noise = jnp.concatenate([drawn.cell, conditioned], axis=1).reshape(len(gram), -1, 3)
    return _AllSums(gram, jnp.concatenate([true, drawn.with_wrench]), noise)


def _root(gram: Array) -> Array:
    """A square root of the covariance that sums with white noise of unit variance have."""
    scale = jnp.sqrt(jnp.diag(gram))
    inverse = jnp.where(scale > 0, 1 / jnp.where(scale > 0, scale, 1), 0)
    nearly_singular = max(1e-12, 64 * len(gram) * float(jnp.finfo(gram.dtype).eps))  # alphas of alike differentiators
    correlation = gram * jnp.outer(inverse, inverse) + nearly_singular * jnp.eye(len(gram))
    return scale[:, None] * _triangular_root(correlation)


def _triangular_root(matrix: Array) -> Array:
    """Cholesky's root in plain arithmetic: LAPACK in small batches can block XLA's threads if each core is a device."""
    index = jnp.arange(len(matrix))

    def step(k, state):
        rest, root = state
        column = jnp.where(index >= k, rest[:, k], 0) * jax.lax.rsqrt(rest[k, k])
        return rest - jnp.outer(column, column), root.at[:, k].set(column)

    return jax.lax.fori_loop(0, len(matrix), step, (matrix, jnp.zeros_like(matrix)))[1]


def _problems(setup: Setup, plan: _Plan, errors: Errors, sums: _AllSums) -> tuple[Sums, Array]:
    """The sums, (estimators, cases, …), and the believed centre of gravity, (cases, 3)."""
    cell, gyro = (*plan.sampled, *plan.conditioned), frozenset(source.name for source in plan.gyro)
    on = [[[float(s.name in case.sources and s.target == t) for t in "FM"] for s in cell] for case in setup.cases]
    acting = [[float(variant == case.sources & gyro) for variant in plan.variants] for case in setup.cases]

    def of_case(errors, on, acting):
        noise = jnp.einsum("akj,kt->atj", sums.noise, on).reshape(-1, 6)
        measured = sums.wrench @ setup.columns.map(setup.body, setup.platform, errors).T + noise
        measured = measured + jnp.outer(sums.gram[:, 0], errors.cell_bias)
        elements = element_map(errors, whole=setup.whole)
        maps = [_placed(setup, elements, acting, k) for k in range(len(setup.estimators))]
        own = [Sums(m @ sums.gram @ m.T, m @ measured[:, :3], m @ measured[:, 3:]) for m in maps]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *own)

    count = len(setup.cases)
    problems = jax.vmap(of_case, out_axes=1)(
        errors, np.reshape(on, (count, len(cell), 2)), np.reshape(acting, (count, len(plan.variants)))
    )
    return problems, setup.body.r_cg_from_q[None] + errors.r_cg


def _placed(setup: Setup, elements: Array, acting: Array, estimator: int) -> Float[Array, "13 all"]:
    """Place an estimator's map of its elements where these stand among all true features and changes."""
    shared = len(setup.sums.gram) - 3 * len(setup.estimators)
    changed = 21 if setup.whole else SHARED - 1
    own = lambda first: np.r_[0:first, first + 3 * estimator : first + 3 * estimator + 3]  # noqa: E731
    true = jnp.zeros((13, len(setup.sums.gram))).at[:, own(shared)].set(elements[:, : shared + 3])
    change = jnp.zeros((13, changed + 3 * len(setup.estimators))).at[:, own(changed)].set(elements[:, shared + 3 :])
    return jnp.concatenate([true, jnp.kron(acting[None], change)], axis=1)
