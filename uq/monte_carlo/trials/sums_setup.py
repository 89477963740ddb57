"""Set-up of trials on sums: what :mod:`uq.monte_carlo.trials.sums_engine` needs of a noise-free run and its noise."""

from collections.abc import Sequence
from functools import partial
from itertools import combinations, product
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Trajectory
from identify.rigid_body.inertia import Body
from identify.signals.differentiate import padded_derivative
from uq.monte_carlo.gram_sums.case_equations import (
    AXES,
    OF_OMEGA_R,
    WEIGHTS,
    NoiseExpectation,
    feature_map,
    sums_by_axes,
    symmetric,
    weighted_sums,
)
from uq.monte_carlo.gram_sums.cases import Case, Estimator
from uq.monte_carlo.gram_sums.error_maps import WrenchBasis, true_elements
from uq.monte_carlo.gram_sums.noise_moments import RunMoments, filtered_backwards, run_moments
from uq.monte_carlo.gram_sums.run_sums import RunSums, delay_nodes
from uq.monte_carlo.trials.engine import TrialSetting
from uq.monte_carlo.trials.sums_engine import ColouredNoise, CrossedNoise, GyroStreams, LoadCellStreams, SumsEngine
from uq.monte_carlo.trials.trial_loop import RUN_ONCE
from uq.sources.constant_errors import CELL_CHANNELS, effect, perturbed
from uq.sources.draws import Mixing
from uq.sources.noise_filters import WHITE, GyroNoise, NoiseFilter
from uq.sources.source import Source

NEGLIGIBLE = 1e-12
"""Eigenvalues of the sums' correlations, in parts of the largest, that are rounding."""
WORST = np.cos(5 * np.pi / 12)
"""Delay, in parts of the reach, where a polynomial through Chebyshev's points is off by most: halfway between two, near
the middle of the range, where the distances to all points have their largest product."""


class TrueRun(NamedTuple):
    """A noise-free run: its signals as the gyro sees them, and their sums, in NumPy."""

    rate: float
    """The rate of the samples [Hz]."""
    valid: Float[np.ndarray, " n"]
    """1 where every estimator has a derivative, else 0."""
    taps: list[np.ndarray]
    """Every estimator's differentiator."""
    signals: Float[np.ndarray, "signals n"]
    """Omega, every estimator's alpha, force and moment, omega at the delay in the middle."""
    elements: Float[np.ndarray, "estimators elements n"]
    """Elements of :func:`uq.monte_carlo.gram_sums.case_equations.feature_map`, likewise."""
    sums: RunSums
    """Sums of all estimators, without noise."""
    remainder: float
    """Error of the sums that are interpolated, in parts of the delay's largest effect."""

    def measured(self, signal: int) -> Float[np.ndarray, "3 n"]:
        """Return what a sensor without errors reads, by its index in :data:`uq.sources.source.SIGNALS`."""
        return self.signals[[slice(-6, -3), slice(-3, None), slice(3)][signal]]


def true_run(setting: TrialSetting) -> TrueRun:
    """Sum over a noise-free run, at as many delays of the gyro as the sources need."""
    motion, sources, estimators = setting.motion, setting.sources, setting.estimators
    on_host = jax.tree.map(np.asarray, motion)
    t, rate = on_host.t - on_host.t[0], (len(on_host.t) - 1) / (on_host.t[-1] - on_host.t[0])
    valid, taps = valid_samples(len(t), estimators), [np.asarray(e.taps) for e in estimators]
    wrench = WrenchBasis.for_sources(sources).sampled(jax.tree.map(np.asarray, setting.body), on_host)
    drifts = "gyro_drift" in perturbed(sources)
    low, high = delay_range(sources)
    middle = (low + high) / 2

    def omega_at(delay: float) -> np.ndarray:
        return np.asarray(_omega_at(setting.trajectory, motion.t, np.float64(delay))) if low < high else on_host.omega

    def elements_at(delay: float) -> list[np.ndarray]:
        omega = omega_at(delay)
        alphas = [padded_derivative(omega, h) for h in taps]
        shared = true_elements(omega, alphas[0], t)[: 15 if drifts else 10]
        return [np.concatenate([shared, alpha]) * valid for alpha in alphas]

    nodes = delay_nodes(low, high)
    at_nodes = [elements_at(node) for node in nodes]
    with_wrench = np.array([[phi @ wrench.T for phi in elements] for elements in at_nodes])
    sums = RunSums.through(nodes, np.array([[phi @ phi.T for phi in elements] for elements in at_nodes]), with_wrench)
    remainder = 0.0
    if low < high:
        # the interpolation's error is S⁽⁷⁾(ξ)/7! Π (τ - τ_k): looked at where the product is largest
        worst = middle + (high - low) / 2 * WORST
        exact = np.array([phi @ wrench.T for phi in elements_at(worst)])
        effect = np.abs(with_wrench[0] - with_wrench[-1]).max()
        remainder = float(np.abs(sums.at(worst).wrench - exact).max() / effect)
    elements = at_nodes[len(nodes) // 2]
    signals = np.concatenate([omega_at(middle), *(phi[-3:] for phi in elements), wrench[:6]])
    return TrueRun(
        rate=float(rate), valid=valid, taps=taps, signals=signals, elements=np.array(elements), remainder=remainder,
        sums=sums,
    )  # fmt: skip


def valid_samples(n: int, estimators: Sequence[Estimator]) -> Float[np.ndarray, " n"]:
    """Return 1 where every estimator has a derivative, else 0."""
    index, halo = np.arange(n), max(len(estimator.taps) for estimator in estimators)
    return ((index >= halo) & (index < n - halo)).astype(float)


def prepare_sums(run: TrueRun, setting: TrialSetting, cases: Sequence[Case], moments: RunMoments) -> SumsEngine:
    """Return what trials on sums need.

    Args:
        run: without noise.
        setting: with sources all of whose effects sums tell.
        cases: sets of sources that act together.
        moments: of the run's sums (:func:`moments_of`).
    """
    cases, body, sources, mixing = tuple(cases), setting.body, setting.sources, setting.mixing
    noises = gyro_noises(sources, mixing, run.rate)
    gyro, expectation = _gyro_streams(noises, cases, moments)
    cell = _cell_streams(sources, mixing, cases, run)
    return SumsEngine(
        cases=cases, body=body, platform=setting.platform, sources=tuple(sources), mixing=tuple(mixing),
        basis=WrenchBasis.for_sources(sources), sums=jax.device_put(run.sums), expectation=expectation, gyro=gyro,
        cell=cell, crossed=_crossed_noise(noises, cell, run, body, cases, moments),
    )  # fmt: skip


SIGMAS = 6.0
"""Standard deviations about the mean that the nodes of a delay reach: one draw in 5e8 is beyond."""


def delay_range(sources: Sequence[Source]) -> tuple[float, float]:
    """Return the earliest and the latest delay of any set of sources [s]: 0, and expectations ± six σ."""
    low = high = 0.0
    for source in sources:
        if source.perturbs == "gyro_delay":
            mean, spread = (float(effect(source, x)) for x in (source.mean, SIGMAS * source.standard_deviation))
            low, high = low + min(0.0, mean - abs(spread)), high + max(0.0, mean + abs(spread))
    return low, high


@partial(jax.jit, compiler_options=RUN_ONCE)
def _omega_at(trajectory: Trajectory, t: Float[Array, " n"], delay: Float[Array, ""]) -> Float[Array, "3 n"]:
    """Return the angular velocity that a gyro reads which is late by a delay [s]."""
    return jax.vmap(trajectory.omega, out_axes=1)(t - delay)


def gyro_noises(sources: Sequence[Source], mixing: Sequence[Mixing], rate: float) -> dict[str, GyroNoise]:
    """Return the noise of omega by the name of its source."""
    return {s.name: _gyro_noise(s, mixing, rate) for s in sources if s.noise and s.of_gyro}


def moments_of(run: TrueRun, noises: Sequence[GyroNoise]) -> RunMoments:
    """Return the moments of a run's sums under these noises of omega, whatever their size."""
    filters = list(dict.fromkeys(f for noise in noises for f in noise.parts)) or [WHITE]
    return run_moments(run.signals, run.valid, run.taps, filters)


def _gyro_streams(
    noises: dict[str, GyroNoise], cases: Sequence[Case], moments: RunMoments
) -> tuple[GyroStreams, NoiseExpectation]:
    """Return the streams of the gyro's noise, and what it adds to the expected sums."""
    covariances: dict[tuple[str, ...], np.ndarray] = {(name,): moments.covariance(x) for name, x in noises.items()}
    for a, b in combinations(noises, 2):  # the products of two sources' noises
        if any({a, b} <= case.sources for case in cases):
            # polarisation: what two noises make together is the sum's covariance less that of each alone
            both = moments.covariance(GyroNoise.together([noises[a], noises[b]]))
            covariances[a, b] = both - covariances[a,] - covariances[b,]
    acts = np.array([[float(case.sources >= set(names)) for case in cases] for names in covariances])
    # a root once, for all trials: a trial's fluctuations are a product with standard normal numbers
    roots = np.array([_root_rows(moments, covariance) for covariance in covariances.values()])
    acting = [GyroNoise.together([noises[name] for name in noises if name in case.sources]) for case in cases]
    terms = [[moments.expectation(noise, k) for k in range(len(moments.algebra.gram))] for noise in acting]
    gram, feature = (jax.device_put(np.array([[term[i] for term in row] for row in terms])) for i in (0, 1))
    shape = (len(covariances), len(moments.algebra.gram), 247, len(moments.algebra.products))
    streams = GyroStreams(
        tuple(map(" ".join, covariances)), jax.device_put(acts.reshape(len(covariances), len(cases))),
        jax.device_put(roots.reshape(shape)),
    )  # fmt: skip
    return streams, NoiseExpectation(gram, feature)


def _gyro_noise(source: Source, mixing: Sequence[Mixing], rate: float) -> GyroNoise:
    """Return a source's noise of omega; its axes may be correlated."""
    # σ_i ρ_ij σ_j; only a source's own axes may be correlated, which is checked before
    correlation = next((np.asarray(m.correlation) for m in mixing if m.names == (source.name,)), np.eye(3))
    parts = source.noise_parts(rate) or []
    sigma = np.sqrt(source.variance) if source.white else np.zeros(3)
    return GyroNoise(
        {part.filter: np.outer(part.sigma, part.sigma) * correlation for part in parts},
        np.asarray(source.shape.skewness) * sigma**3, np.asarray(source.shape.excess_kurtosis) * sigma**4,
    )  # fmt: skip


def _root_rows(moments: RunMoments, covariance: np.ndarray) -> Float[np.ndarray, "estimators 247 rank"]:
    """Return a square root of the sums' covariance, its rows in every estimator's order."""
    gram, wrench = (x.reshape(len(x), -1) for x in (moments.algebra.gram, moments.algebra.wrench))
    return np.asarray(square_root(covariance)[np.concatenate([gram, wrench], axis=1)])


def square_root(covariance: Float[np.ndarray, "*sets k k"]) -> Float[np.ndarray, "*sets k k"]:
    """Return a square root of each covariance: of its correlations the symmetric one, which alone is continuous.

    Of correlations, since the sums differ in size by powers of ten, and rounding is told by size. Eigenvectors of equal
    values are the rounding's choice, and so would be the draws of a seed.
    """
    scale = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), 0))
    inverse = np.divide(1, scale, out=np.zeros_like(scale), where=scale > 0)
    values, vectors = np.linalg.eigh(covariance * inverse[..., :, None] * inverse[..., None, :])
    values = np.where(
        values > NEGLIGIBLE * values[..., -1:], values, 0
    )  # not left out: another noise, the same program
    return np.asarray(scale[..., None] * (vectors * np.sqrt(values)[..., None, :]) @ vectors.swapaxes(-1, -2))


def _cell_streams(
    sources: Sequence[Source], mixing: Sequence[Mixing], cases: Sequence[Case], run: TrueRun
) -> LoadCellStreams:
    """Return the streams of the load cell's noise."""
    noise = {s.name: s for s in sources if s.noise and not s.of_gyro}
    joined = {name: frozenset(mix.names) & set(noise) for mix in mixing for name in mix.names if name in noise}
    groups = list(dict.fromkeys(joined.get(name, frozenset([name])) for name in noise))
    nothing = np.zeros((len(cases), 6, 6, len(groups)))
    white, driving = nothing.copy(), dict[NoiseFilter, np.ndarray]()
    for (k, case), (stream, names) in product(enumerate(cases), enumerate(groups)):
        acting = [source for source in noise.values() if source.name in names & case.sources]
        white[k, :, :, stream] = white_covariance([s for s in acting if s.white], mixing)
        for source in (s for s in acting if not s.white):
            for part in source.noise_parts(run.rate) or []:
                channels = CELL_CHANNELS[source.target] + np.arange(3)
                size = white if part.filter == WHITE else driving.setdefault(part.filter, nothing.copy())
                size[k, channels, channels, stream] += part.sigma**2
    coloured = []
    for filter_, size in driving.items():
        streams = np.flatnonzero(size.any(axis=(0, 1, 2)))
        # Ωᵀ L w = (Lᵀ Ω)ᵀ w: the features behind the filter have the Gram matrix that white noise needs
        behind = np.array([phi @ phi.T for phi in (filtered_backwards(x, filter_) for x in run.elements)])
        coloured.append(ColouredNoise(tuple(streams.tolist()), *jax.device_put((size[..., streams], behind))))
    first = tuple(next(name for name in noise if name in group) for group in groups)
    return LoadCellStreams(first, jax.device_put(white), tuple(coloured))


def _crossed_noise(
    noises: dict[str, GyroNoise],
    cell: LoadCellStreams,
    run: TrueRun,
    body: Body,
    cases: Sequence[Case],
    moments: RunMoments,
) -> CrossedNoise:
    """Return the weights that correlate the load cell's noise between cases whose gyro noise differs.

    The right side ``Ωᵀ e`` is ``Ω₀ᵀ e + Σ N_gᵀ e`` for a true regressor and the noise of each source of the gyro's in
    it, terms that are uncorrelated, of covariances ``A₀ = Σ Ω₀ᵀ S Ω₀`` and ``A_g = E Σ N_gᵀ S N_g``. With R a root of
    ``A₀ + Σ A_g``, the weights ``W = R⁻¹ root(A)`` have ``Σ W Wᵀ = 1``: numbers so weighted are standard normal
    again, so that a trial may map them by the root of its own covariance, and no case's distribution changes. Drawn
    without them, cases with and without the gyro's noise would share too much, and a budget would miss what both
    noises make together.

    Args:
        noises: of the gyro, by source.
        cell: streams of the load cell's noise.
        run: without noise.
        body: that is moved.
        cases: sets of sources that act together.
        moments: of the run's sums.
    """
    features = feature_map(np.eye(3), np.zeros(3), np.zeros(3) if run.elements.shape[1] > 13 else None)
    rows, r_cg = features[OF_OMEGA_R], np.asarray(body.r_cg_from_q)[:, None, None]

    def covariances(by_axes: np.ndarray, noise: Array) -> Float[np.ndarray, "cases streams 6 6"]:
        spread = np.moveaxis(np.asarray(noise), 0, 2)
        return symmetric(weighted_sums(by_axes[:, :, None, None], spread, r_cg)).transpose(2, 3, 0, 1)

    alone: list[np.ndarray] = []
    with_gyro: list[list[np.ndarray]] = []
    for k, gram in enumerate(run.sums.gram[0]):
        true = covariances(sums_by_axes(rows @ gram @ rows.T), cell.white)
        for noise in cell.coloured:
            behind = sums_by_axes(rows @ np.asarray(noise.behind)[k] @ rows.T)
            true[:, list(noise.streams)] += covariances(behind, noise.driving)
        size = np.trace(true, axis1=2, axis2=3)[..., None, None]
        true += np.where(size, NEGLIGIBLE * size, 1.0) * np.eye(6)  # so that it has a root where nothing acts
        roots = []
        for name, gyro in noises.items():
            # E N_gᵀ S N_g: the products of features that the noise adds on the average, weighed by S as the true ones
            # are
            added = WEIGHTS @ moments.expectation(gyro, k).gram @ features @ gram[:, 0]
            acts = np.array([name in case.sources for case in cases])[:, None, None, None]
            roots.append(square_root(acts * covariances(added.reshape(len(AXES), 21), cell.white)))
        # R Rᵀ = A₀ + Σ A_g; then W = R⁻¹ root(A) has Σ W Wᵀ = R⁻¹ (Σ A) R⁻ᵀ = 1
        root = np.linalg.cholesky(true + sum(x @ x.swapaxes(2, 3) for x in roots))
        alone.append(np.linalg.solve(root, np.linalg.cholesky(true)))
        with_gyro.append([np.linalg.solve(root, x) for x in roots])
    names = tuple(f"{gyro} {stream}" for gyro in noises for stream in cell.names)
    shape = (len(alone), len(noises), len(cases), len(cell.names), 6, 6)
    by_gyro = np.array(with_gyro).reshape(shape).transpose(2, 0, 1, 4, 5, 3)
    return CrossedNoise(names, jax.device_put(np.array(alone).transpose(1, 0, 3, 4, 2)), jax.device_put(by_gyro))


def white_covariance(sources: Sequence[Source], mixing: Sequence[Mixing]) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of the load cell's white noise of one sample that these sources make together."""
    spread = {s.name: np.eye(6, 3, -CELL_CHANNELS[s.target]) * np.asarray(s.standard_deviation)[None] for s in sources}
    total = sum((x @ x.T for x in spread.values()), np.zeros((6, 6)))
    for mix in mixing:
        places = {name: place for name, place in mix.places.items() if name in spread}
        for (first, rows), (second, columns) in product(places.items(), repeat=2):
            independent = np.eye(3) if first == second else 0.0
            total += spread[first] @ (np.asarray(mix.correlation)[rows, columns] - independent) @ spread[second].T
    return total
