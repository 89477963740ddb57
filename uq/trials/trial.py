"""One trial of the Monte Carlo: draws in, estimates of every case and estimator out. A pure function of a key.

A trial visits its samples in blocks and keeps only sums (:mod:`identify.estimators.gram`) over *elements*: the
features, or with errors that map the angular velocity those of :func:`uq.gram_sums.error_maps.element_map`.
The noise-free sums are computed once, and what the gyro's noise changes is summed apart: with the change δ of the
elements φ, ``(φ + δ)(φ + δ)ᵀ - φφᵀ = (φ + δ/2) δᵀ + δ (φ + δ/2)ᵀ``, so that one product is enough. Every case (all
sources, one group, one source) and every estimator is solved from the sums of the same draws, over the samples where
all estimators have a derivative. Constant errors are linear maps of these sums (:mod:`uq.gram_sums.error_maps`).

White normal noise of the load cell enters through sums that are linear in it, so that, given the gyro's draws, these
sums are normal with a known covariance. ``sampling="conditioned"`` draws them from it; ``"samples"`` draws the noise of
every sample. A case has the same distribution either way; cases with and without noise of the gyro draw from the same
normal numbers. Noise of other distributions is always drawn sample by sample.

``sampling="collapsed"`` draws the gyro's sums, too: :mod:`uq.trials.sums_engine`. Coloured noise is drawn by sample. A
delay of the gyro changes its samples as noise does, by a polynomial in the delay (:mod:`uq.gram_sums.delayed_omega`).
Cases that sums cannot express (saturation, a coarse quantisation) need every sample: :mod:`uq.trials.samplewise`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from identify.estimators.gram import Sums, solve
from identify.motion.trajectory import Motion
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import features
from identify.signals.differentiate import derivative
from uq.gram_sums.covariance_root import covariance_root
from uq.gram_sums.delayed_omega import DelayedOmega, displacement
from uq.gram_sums.error_maps import OF_THE_GYRO, Columns, Platform, changes_of_elements, element_map, true_elements
from uq.gram_sums.setup import (
    SHARED,
    Case,
    EqualRotations,
    Estimator,
    Sampling,
    Setup,
    Signals,
    cases_of,
    noisy_count,
)
from uq.sources.constant_errors import Errors, errors_of_cases, over_cases, perturbed
from uq.sources.draws import BLOCK, Mixing, draw_constants, draw_sums, noise_at_rest, noise_of_block, noise_streams
from uq.sources.random_normals import in_order, joined
from uq.sources.source import Source
from uq.trials.trial_plan import Late, Plan, late_of, plan_of


class TrialEstimates(NamedTuple):
    """Estimates of one trial."""

    inertia: Float[Array, "estimators cases 6"]
    """Packed tensors [kg·m²]; NaN where a case could not be solved."""
    ok: Bool[Array, "estimators cases"]
    """Which could."""

    @classmethod
    def none(cls, estimators: int) -> "TrialEstimates":
        """Return those of no case."""
        return cls(jnp.zeros((estimators, 0, 6)), jnp.zeros((estimators, 0), bool))


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
    cases: Sequence[Case] | None = None,
    delayed: DelayedOmega | None = None,
) -> Setup:
    """Cut a noise-free motion and its wrench into blocks, with the noise-free sums of every estimator.

    By NumPy: it is done once, and its sixty small steps would take JAX longer to compile than the campaign's trials.

    ``cases``: sets of sources that act together, None for all of the breakdown; ``delayed``: where one delays the gyro.
    """
    on_host = jax.tree.map(np.asarray, motion)
    columns = Columns.of(sources)
    gyro_mapped = bool(perturbed(sources) & OF_THE_GYRO)
    t, omega, alpha = on_host.t - on_host.t[0], on_host.omega, on_host.alpha
    shared = true_elements(omega, alpha, t) if gyro_mapped else features(omega, alpha)[:SHARED]
    valid = valid_samples(len(t), estimators)
    taps = [np.asarray(estimator.taps) for estimator in estimators]
    alphas = [np.pad(derivative(omega, each), ((0, 0), (len(each),) * 2)) for each in taps]
    of_noise = [np.zeros((noisy_count(gyro_mapped, estimators), len(t)))] if gyro_mapped else []
    phi = np.concatenate([shared, *alphas, *of_noise]) * valid[None]
    wrench = columns.sampled(jax.tree.map(np.asarray, body), on_host)
    halo = _halo(estimators)
    delayed = delayed or DelayedOmega(jnp.zeros((0, *omega.shape)), jnp.ones(()), 0.0)
    powers = delayed.with_alphas(taps)
    displacements = _blocks(powers.reshape(math.prod(powers.shape[:-1]), len(t)), halo)
    displacements = displacements.reshape(len(displacements), *powers.shape[:-1], BLOCK)
    signals = Signals(
        jnp.arange(-(-len(t) // BLOCK)),
        jax.device_put(_blocks(np.concatenate([phi, wrench]).astype(dtype), halo)),
        jax.device_put(_blocks(valid[None].astype(dtype), halo)[:, 0]),
        jax.device_put(displacements.astype(dtype)),
    )
    force, moment, other = jax.device_put(np.split(phi @ wrench.T, (3, 6), axis=1))
    return Setup(
        body, platform, signals, delayed.reach, jax.device_put((len(t) - 1) / t[-1]),
        Sums(jax.device_put(phi @ phi.T), force, moment), other, tuple(sources), tuple(mixing), tuple(estimators),
        tuple(cases or cases_of(sources)), columns, gyro_mapped, np.dtype(dtype), sampling,
    )  # fmt: skip


def valid_samples(n: int, estimators: Sequence[Estimator]) -> Float[np.ndarray, " n"]:
    """Return 1 where every estimator has a derivative, else 0."""
    index, halo = np.arange(n), _halo(estimators)
    return ((index >= halo) & (index < n - halo)).astype(float)


def _halo(estimators: Sequence[Estimator]) -> int:
    """Samples that the longest differentiator needs on either side."""
    return max(estimator.taps.shape[0] for estimator in estimators)


def _blocks(signal: np.ndarray, halo: int) -> np.ndarray:
    """Cut component-first samples into zero-padded blocks, block first, the first of them preceded by a halo."""
    count = -(-signal.shape[1] // BLOCK)
    padded = np.pad(signal, ((0, 0), (halo, count * BLOCK - signal.shape[1])))[:, : count * BLOCK]
    return padded.reshape(signal.shape[0], count, BLOCK).swapaxes(0, 1)


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
    together = trials_of_equal_rotations(EqualRotations((setup,), setup.signals), key, indices, at_once=at_once)
    return jax.tree.map(lambda leaf: leaf[:, 0], together)


def trials_of_equal_rotations(
    equal: EqualRotations, key: Key[Array, ""], indices: Int[Array, " trials"], *, at_once: bool = False
) -> TrialEstimates:
    """Run several trials of several experiments at once: the same numbers as one by one.

    Returns:
        The estimates, trials leading, then the experiments.
    """
    first = replace(equal.setups[0], signals=equal.signals)
    plan = plan_of(first)
    drawn = _visit_blocks(first, plan, key, indices, _all_at_once if at_once else _one_by_one)

    def solved(index, drawn):
        draws = draw_constants(first.sources, first.mixing, key, index, first.dtype)
        errors = errors_of_cases(first.sources, draws, [case.sources for case in first.cases])
        estimates = []
        for number, setup in enumerate(equal.setups):
            setup = replace(setup, sums=setup.sums._replace(gram=first.sums.gram))  # what follows from it is done once
            of_setup = drawn._replace(products=drawn.products[:, equal.rows(number)])
            sums, r_cg = _problems(setup, plan, errors, _all_sums(setup, plan, of_setup, key, index))
            estimate = jax.vmap(jax.vmap(solve), in_axes=(0, None))(sums, r_cg)
            estimates.append(TrialEstimates(estimate.inertia, estimate.ok))
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *estimates)

    return jax.vmap(solved)(indices, drawn)


def _one_by_one(of_trial, room, trials):
    return jax.lax.scan(of_trial, room, trials)[1]


def _all_at_once(of_trial, room, trials):
    return jax.vmap(lambda trial: of_trial(room, trial)[1])(trials)


class _Drawn(NamedTuple):
    """Sums over one trial. A change is what a variant's gyro noise adds to an element; variant by variant."""

    products: Float[Array, "variants rows changes"]
    """Of the elements, half changed, and of the wrench and the columns that follow it, with the changes."""
    true: Float[Array, "elements noise"]
    """Of the true elements with the load cell's noise that is drawn by sample, three columns a source."""
    changes: Float[Array, "variants changes noise"]
    """Of the changes with it."""


class _Room(NamedTuple):
    """Where a trial works: one trial after the other overwrites what its noise changes, and nothing else."""

    half: Float[Array, "rows 1200"]
    """The noise-free signals, with half the changes added; then the load cell's noise that is drawn by sample."""
    changes: Float[Array, "padded 1200"]
    """The changes, filled up to the width of a processor's matrix product."""


def _visit_blocks(setup: Setup, plan: Plan, key, indices, over_trials) -> _Drawn:
    """Scan over the blocks; each trial's last samples of noise are carried over, for derivatives across seams."""
    groups = plan.gyro, plan.sampled

    def of_trial(signals, room, trial):
        late, drawn, tails = trial
        gyro, cell = wide = jax.tree.map(in_order, tails, drawn)
        rows = joined([jnp.zeros((0, BLOCK), setup.dtype), *(noise[:, :BLOCK] for noise in cell)], axis=0)
        room, products = _block_products(setup, plan, signals, room, late, gyro, rows)
        return room, (jax.tree.map(lambda noise: noise[:, BLOCK:], wide), products, rows)

    def of_trials(signals, tails, memory):
        # drawn outside the function that uses them: XLA would draw again for each use
        drawn, memory = jax.vmap(partial(draw, signals.block), axis_size=len(indices))(streams, memory)
        room = _room(setup, plan, signals)
        tails, products, cell = over_trials(partial(of_trial, signals), room, (late, drawn, tails))
        of_true = jnp.einsum("en,tcn->tec", signals.noise_free[: setup.changed.stop], cell)  # of all trials at once
        products, of_changes = jnp.split(products, [len(signals.noise_free)], axis=2)
        return tails, memory, _Drawn(products, of_true, of_changes.swapaxes(2, 3))

    def draw(block, streams, memory):
        of_group = [
            noise_of_block(sources, setup.mixing, keys, before, block, setup.rate, setup.dtype)
            for sources, keys, before in zip(groups, streams, memory, strict=True)
        ]
        return [drawn for drawn, _ in of_group], [after for _, after in of_group]

    def visit(carry, signals):
        *noise, more = of_trials(signals, *carry[:-1])
        return (*noise, jax.tree.map(lambda total, added: total + added.astype(total.dtype), carry[-1], more)), None

    late = jax.vmap(partial(late_of, setup, plan, key))(indices)
    streams = jax.vmap(lambda index: [noise_streams(s, key, index) for s in groups])(indices)
    halo = _halo(setup.estimators)
    silence = lambda sources, samples: [jnp.zeros((len(indices), 3, samples), setup.dtype) for _ in sources]  # noqa: E731
    tails = [silence(plan.gyro, 2 * halo), silence(plan.sampled, halo)]
    at_rest = lambda _: [noise_at_rest(sources, setup.dtype) for sources in groups]  # noqa: E731
    memory = jax.vmap(at_rest)(indices)
    first_block = jax.tree.map(lambda leaf: leaf[0], setup.signals)
    zero = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), jax.eval_shape(of_trials, first_block, tails, memory)[-1])
    return jax.lax.scan(visit, (tails, memory, zero), setup.signals)[0][-1]


def _room(setup: Setup, plan: Plan, signals: Signals) -> _Room:
    count = noisy_count(setup.gyro_mapped, setup.estimators)
    cell = jnp.zeros((3 * len(plan.sampled), BLOCK), setup.dtype)
    return _Room(jnp.concatenate([signals.noise_free, cell]), jnp.zeros((count + -count % 16, BLOCK), setup.dtype))


def _block_products(
    setup: Setup, plan: Plan, signals: Signals, room: _Room, late: Late, gyro, cell
) -> tuple[_Room, Float[Array, "variants rows changes"]]:
    """Products of one block: ``gyro`` holds each source's noise with a halo on either side, ``cell`` all sources'."""
    count = setup.changed.stop - setup.changed.start
    room = room._replace(half=jax.lax.dynamic_update_slice_in_dim(room.half, cell, len(signals.noise_free), 0))
    moved = [_moved(setup, noise) for noise in gyro]  # once a source, not once a variant
    for part, gyro_map in zip(*late, strict=True):
        delayed = displacement(signals.displacement, part)
        delayed = gyro_map @ delayed if setup.gyro_mapped else delayed
        moved.append([delayed[0], delayed[1:].reshape(-1, BLOCK)])

    def of_variant(room, acting):  # in eight of XLA's steps: from nine on, its threads share them, and mostly wait
        still = [jnp.zeros((count, BLOCK), setup.dtype) for count in (3, 3 * len(setup.estimators))]
        total = [sum(map(jnp.multiply, acting, added), nothing) for nothing, *added in zip(still, *moved, strict=True)]
        room = _changed_room(setup, signals, room, total)
        return room, (room.half @ room.changes.T)[:, :count]

    return jax.lax.scan(of_variant, room, plan.acting.astype(setup.dtype))


def _moved(setup: Setup, noise) -> list[Array]:
    """What noise in omega (3, halo + block + halo) adds to omega and to every estimator's alpha: linear in it."""
    halo = _halo(setup.estimators)
    taps = [estimator.taps.astype(noise.dtype) for estimator in setup.estimators]
    alphas = [derivative(noise[:, halo - len(t) : halo + BLOCK + len(t)], t) for t in taps]
    return [noise[:, halo : halo + BLOCK], joined(alphas, axis=0)]


def _changed_room(setup: Setup, signals: Signals, room: _Room, moved) -> _Room:
    """Write what noise changes, group by group in its place, which XLA turns into fast loops on a CPU."""
    changes, start = room.changes, 0
    omega, alphas = moved
    for change in (*changes_of_elements(signals.noise_free, omega, gyro_mapped=setup.gyro_mapped), alphas):
        changes = jax.lax.dynamic_update_slice_in_dim(changes, change * signals.valid[None], start, 0)
        start += len(change)
    half = signals.noise_free[setup.changed] + changes[:start] / 2
    return _Room(jax.lax.dynamic_update_slice_in_dim(room.half, half, setup.changed.start, 0), changes)


class _AllSums(NamedTuple):
    """Sums over the elements of each variant; the first is without noise of the gyro."""

    gram: Float[Array, "variants elements elements"]
    wrench: Float[Array, "variants elements columns"]
    noise: Float[Array, "variants elements sources 3"]
    """With the load cell's noise, first of the sources drawn by sample, then of those whose sums are drawn."""


def _all_sums(setup: Setup, plan: Plan, drawn: _Drawn, key, index) -> _AllSums:
    """Add to the true sums what noise changes; Gram sums are drawn from the same normal numbers in every variant."""
    first, elements = setup.changed.start, setup.changed.stop
    change = jnp.pad(drawn.products[:, :elements], ((1, 0), (0, 0), (first, 0)))
    gram = setup.sums.gram[None] + change + change.swapaxes(1, 2)
    true = jnp.concatenate([setup.sums.force, setup.sums.moment, setup.other], axis=1)
    wrench = true[None] + jnp.pad(drawn.products[:, elements:].swapaxes(1, 2), ((1, 0), (first, 0), (0, 0)))
    noise = [drawn.true[None] + jnp.pad(drawn.changes, ((1, 0), (first, 0), (0, 0)))]
    if plan.conditioned:
        draws = draw_sums(plan.conditioned, setup.mixing, key, index, elements)
        noise.append(jax.vmap(covariance_root)(gram) @ jnp.concatenate(draws, axis=1))
    return _AllSums(gram, wrench, jnp.concatenate(noise, axis=2).reshape(*gram.shape[:2], -1, 3))


def _problems(setup: Setup, plan: Plan, errors: Errors, sums: _AllSums) -> tuple[Sums, Array]:
    """The sums, (estimators, cases, …), and the believed centre of gravity, (cases, 3)."""
    cell = (*plan.sampled, *plan.conditioned)
    on = [[[float(s.name in case.sources and s.signal == k) for k in (0, 1)] for s in cell] for case in setup.cases]
    variant = np.array(plan.of_case)

    def of_case(errors, on, sums):
        noise = jnp.einsum("akj,kt->atj", sums.noise, on).reshape(-1, 6)
        measured = sums.wrench @ setup.columns.map(setup.body, setup.platform, errors).T + noise
        measured = measured + sums.gram[:, :1] * errors.cell_bias[None]
        m = element_map(errors, gyro_mapped=setup.gyro_mapped)
        places = [_elements_of(setup, k) for k in range(len(setup.estimators))]
        problems = [Sums(m @ sums.gram[np.ix_(k, k)] @ m.T, m @ measured[k, :3], m @ measured[k, 3:]) for k in places]
        return jax.tree.map(lambda *leaves: jnp.stack(leaves), *problems)

    active = np.reshape(on, (len(setup.cases), len(cell), 2))
    problems = over_cases(of_case, [errors], active, jax.tree.map(lambda leaf: leaf[variant], sums), out_axes=1)
    return problems, setup.body.r_cg_from_q[None] + errors.r_cg


def _elements_of(setup: Setup, estimator: int) -> np.ndarray:
    """Where an estimator's elements stand among all: the shared ones, and its alphas, true and of noise."""
    alphas = 3 * estimator + np.arange(3)
    if not setup.gyro_mapped:
        return np.r_[:SHARED, SHARED + alphas]
    true, noisy = 15, 15 + 3 * len(setup.estimators)
    return np.r_[:true, true + alphas, noisy : noisy + 21, noisy + 21 + alphas]
