"""Set-up of trials on sums: one pass over a noise-free run leaves all that they need (:mod:`uq.trials.sums_engine`)."""

from collections.abc import Sequence
from itertools import combinations, product

import jax
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Motion, Trajectory
from identify.rigid_body.inertia import Body
from identify.signals.differentiate import derivative
from uq.gram_sums.case_equations import LOWER9, NoiseExpectation
from uq.gram_sums.error_maps import Columns, Platform, true_elements
from uq.gram_sums.noise_algebra import expectation_terms
from uq.gram_sums.run_moments import RunMoments, filtered_backwards, run_moments
from uq.gram_sums.setup import Case, Estimator, cases_of
from uq.sources.constant_errors import CELL_CHANNELS, effect, perturbed
from uq.sources.draws import Mixing
from uq.sources.noise_filters import WHITE, GyroNoise, NoiseFilter
from uq.sources.source import Source
from uq.trials.sums_engine import CellStream, GyroStream, SumsEngine
from uq.trials.trial import valid_samples

NEGLIGIBLE = 1e-12
"""Eigenvalues of the sums' correlations, in parts of the largest, that are rounding."""
DELAY_NODES = 7
"""Chebyshev's points at which exact sums are interpolated: six powers of the delay beyond the constant."""


def prepare_sums(
    motion: Motion,
    body: Body,
    platform: Platform,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    trajectory: Trajectory,
    mixing: Sequence[Mixing] = (),
    cases: Sequence[Case] | None = None,
) -> SumsEngine:
    """Return what trials on sums need of a noise-free motion, in float64.

    Args:
        motion: the samples of the trajectory.
        body: that is moved.
        platform: what carries it.
        sources: all of whose effects sums tell.
        estimators: with their differentiators.
        trajectory: of the motion, which a delayed gyro reads at other instants.
        mixing: sources that are correlated.
        cases: sets of sources that act together; None for all of the breakdown.
    """
    cases, columns = tuple(cases or cases_of(sources)), Columns.of(sources)
    on_host = jax.tree.map(np.asarray, motion)
    t, rate = on_host.t - on_host.t[0], (len(on_host.t) - 1) / (on_host.t[-1] - on_host.t[0])
    valid, taps = valid_samples(len(t), estimators), [np.asarray(e.taps) for e in estimators]
    wrench = columns.sampled(jax.tree.map(np.asarray, body), on_host)
    drifts = "gyro_drift" in perturbed(sources)
    middle, reach = delay_range(sources)
    nodes = np.cos(np.pi * (np.arange(DELAY_NODES) + 0.5) / DELAY_NODES) if reach else np.zeros(1)
    gram, with_wrench = [], []
    for node in nodes:
        omega = omega_at(trajectory, motion.t, middle + reach * node) if reach else on_host.omega
        elements = [_elements(omega, h, t, drifts) * valid for h in taps]
        gram.append([phi @ phi.T for phi in elements])
        with_wrench.append([phi @ wrench.T for phi in elements])
    omega = omega_at(trajectory, motion.t, middle) if reach else on_host.omega
    signals = np.concatenate([omega, *(_alpha(omega, h) for h in taps), wrench[:6]])
    gyro, expectation = _gyro_streams(sources, mixing, cases, rate, signals, valid, taps)
    place = jax.device_put
    return SumsEngine(
        body=body, platform=platform, sources=tuple(sources), mixing=tuple(mixing), cases=cases, columns=columns,
        gram=place(np.array(gram)), wrench=place(np.array(with_wrench)),
        delay_weights=place(np.linalg.inv(np.vander(nodes, increasing=True)).T),
        middle=place(np.float64(middle)), reach=place(np.float64(reach or 1.0)),
        expectation=expectation, gyro=gyro, cell=_cell_streams(sources, mixing, cases, rate, elements),
    )  # fmt: skip


def _alpha(omega: np.ndarray, taps: np.ndarray) -> np.ndarray:
    return np.pad(derivative(omega, taps), ((0, 0), (len(taps),) * 2))


def _elements(omega: np.ndarray, taps: np.ndarray, t: np.ndarray, drifts: bool) -> Float[np.ndarray, "elements n"]:
    """Return the elements of :func:`uq.gram_sums.case_equations.feature_map` at each sample."""
    alpha = _alpha(omega, taps)
    shared = true_elements(omega, alpha, t)
    return np.concatenate([shared if drifts else shared[:10], alpha])


SIGMAS = 6.0
"""Standard deviations about the mean that the nodes of a delay reach: one draw in 5e8 is beyond."""


def delay_range(sources: Sequence[Source]) -> tuple[float, float]:
    """Return middle and half width of the delays that matter [s]: none, and all sources' expectations ± six σ."""
    delays = [source for source in sources if source.perturbs == "gyro_delay"]
    mean, spread = (
        sum(float(effect(s, draw)) for s, draw in zip(delays, draws, strict=True))
        for draws in ([s.mean for s in delays], [SIGMAS * s.standard_deviation for s in delays])
    )
    low, high = min(0.0, mean - abs(spread)), max(0.0, mean + abs(spread))
    return (low + high) / 2, (high - low) / 2


@jax.jit
def _omega_at(trajectory: Trajectory, t: Float[Array, " n"]) -> Float[Array, "3 n"]:
    return jax.vmap(trajectory.omega, out_axes=1)(t)


def omega_at(trajectory: Trajectory, t: Float[Array, " n"], delay: float) -> Float[np.ndarray, "3 n"]:
    """Return the angular velocity that a gyro reads which is late by a delay [s]."""
    return np.asarray(_omega_at(trajectory, t - delay))


def _gyro_streams(
    sources: Sequence[Source], mixing: Sequence[Mixing], cases: Sequence[Case], rate: float,
    signals: np.ndarray, valid: np.ndarray, taps: Sequence[np.ndarray],
) -> tuple[tuple[GyroStream, ...], NoiseExpectation]:  # fmt: skip
    """Return the streams of the gyro's noise, and what it adds to the expected sums."""
    noises = {s.name: _gyro_noise(s, mixing, rate) for s in sources if s.noise and s.of_gyro}
    filters = list(dict.fromkeys(f for noise in noises.values() for f in noise.parts)) or [WHITE]
    moments = run_moments(signals, valid, taps, filters)
    alone = {name: moments.covariance(noise) for name, noise in noises.items()}
    streams = [
        GyroStream(name, tuple(name in case.sources for case in cases), _root_rows(moments, covariance))
        for name, covariance in alone.items()
    ]
    for a, b in combinations(noises, 2):  # the products of two sources' noises
        both = moments.covariance(_together([noises[a], noises[b]])) - alone[a] - alone[b]
        acts = tuple({a, b} <= case.sources for case in cases)
        streams.append(GyroStream(f"{a} {b}", acts, _root_rows(moments, both)))
    acting = [[noises[name] for name in noises if name in case.sources] for case in cases]
    terms = [[_expectation(moments, _together(noise), k) for k in range(len(taps))] for noise in acting]
    gram, feature = (jax.device_put(np.array([[x[i] for x in row] for row in terms])) for i in (0, 1))
    return tuple(streams), NoiseExpectation(gram, feature)


def _gyro_noise(source: Source, mixing: Sequence[Mixing], rate: float) -> GyroNoise:
    """Return a source's noise of omega; its axes may be correlated."""
    correlation = next((np.asarray(m.correlation) for m in mixing if m.names == (source.name,)), np.eye(3))
    parts = source.error_kind.noise_parts(source, rate)
    sigma = parts[0].sigma if source.white else np.zeros(3)
    return GyroNoise(
        {part.filter: np.outer(part.sigma, part.sigma) * correlation for part in parts},
        np.asarray(source.shape.skewness) * sigma**3, np.asarray(source.shape.excess_kurtosis) * sigma**4,
    )  # fmt: skip


def _together(noises: Sequence[GyroNoise]) -> GyroNoise:
    """Return independent noises added."""
    parts: dict[NoiseFilter, np.ndarray] = {}
    for noise in noises:
        for filter_, size in noise.parts.items():
            parts[filter_] = parts.get(filter_, 0) + size
    zero = np.zeros(3)
    return GyroNoise(
        parts, sum((n.third_cumulant for n in noises), zero), sum((n.fourth_cumulant for n in noises), zero)
    )


def _root_rows(moments: RunMoments, covariance: np.ndarray) -> Float[Array, "estimators 247 rank"]:
    """Return a square root of the sums' covariance, its rows in every estimator's order."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0))
    inverse = np.divide(1, scale, out=np.zeros_like(scale), where=scale > 0)
    values, vectors = np.linalg.eigh(covariance * np.outer(inverse, inverse))
    values = np.where(values > NEGLIGIBLE * values[-1], values, 0)  # not left out: another noise, the same program
    root = (scale[:, None] * vectors * np.sqrt(values))[:, ::-1]  # the largest first
    gram, wrench = (x.reshape(len(x), -1) for x in (moments.algebra.gram, moments.algebra.wrench))
    return jax.device_put(root[np.concatenate([gram, wrench], axis=1)])


def _expectation(moments: RunMoments, noise: GyroNoise, estimator: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what noise adds to expected sums of an estimator: exact for normal noise of any size."""
    sizes = [(size, moments.omega[f], moments.alpha[f][estimator]) for f, size in noise.parts.items()]
    covariances = np.zeros((2, 3, 3))
    for size, of_omega, of_alpha in sizes:
        covariances += np.array([of_omega, of_alpha])[:, None, None] * size
    terms = np.einsum("kmcijf,cij->kmf", expectation_terms(), covariances)
    features = terms[0, :, 0]  # of a feature alone, which is its product with 1
    pairs = terms[4 + LOWER9[:, 0], 4 + LOWER9[:, 1]]
    pairs[:, 0] += pairs @ features / 2  # fourth order
    return pairs, features[4:]


def _cell_streams(
    sources: Sequence[Source],
    mixing: Sequence[Mixing],
    cases: Sequence[Case],
    rate: float,
    elements: Sequence[np.ndarray],
) -> tuple[CellStream, ...]:
    """Return the streams of the load cell's noise.

    Args:
        sources: of the experiment.
        mixing: sources that are correlated.
        cases: sets of sources that act together.
        rate: sample rate [Hz].
        elements: every estimator's, at each sample.
    """
    noise = {s.name: s for s in sources if s.noise and not s.of_gyro}
    joined = {name: frozenset(mix.names) & set(noise) for mix in mixing for name in mix.names if name in noise}
    groups = list(dict.fromkeys(joined.get(name, frozenset([name])) for name in noise))
    behind: dict[NoiseFilter, Array] = {}
    streams = []
    for names in groups:
        members = [noise[name] for name in noise if name in names]
        driving: dict[NoiseFilter, np.ndarray] = {WHITE: np.zeros((len(cases), 6, 6))}
        for number, case in enumerate(cases):
            acting = [s for s in members if s.name in case.sources]
            driving[WHITE][number] = white_covariance([s for s in acting if s.white], mixing)
            for source in acting:
                if source.white:
                    continue
                for part in source.error_kind.noise_parts(source, rate):
                    first = CELL_CHANNELS[source.target]
                    size = driving.setdefault(part.filter, np.zeros((len(cases), 6, 6)))
                    size[number, range(first, first + 3), range(first, first + 3)] += part.sigma**2
        for filter_ in driving.keys() - behind.keys() - {WHITE}:
            filtered = [filtered_backwards(phi, filter_) for phi in elements]
            behind[filter_] = jax.device_put(np.array([phi @ phi.T for phi in filtered]))
        white = jax.device_put(driving.pop(WHITE))
        coloured = tuple((jax.device_put(size), behind[f]) for f, size in driving.items())
        streams.append(CellStream(members[0].name, white, coloured))
    return tuple(streams)


def white_covariance(sources: Sequence[Source], mixing: Sequence[Mixing]) -> Float[np.ndarray, "6 6"]:
    """Return the covariance of the load cell's white noise of one sample that these sources make together."""
    spread = {s.name: np.eye(6, 3, -CELL_CHANNELS[s.target]) * np.asarray(s.standard_deviation)[None] for s in sources}
    total = sum((x @ x.T for x in spread.values()), np.zeros((6, 6)))
    for mix in mixing:
        ends = np.cumsum(mix.axes)
        places = {name: slice(e - n, e) for name, n, e in zip(mix.names, mix.axes, ends, strict=True) if name in spread}
        for (first, rows), (second, columns) in product(places.items(), repeat=2):
            independent = np.eye(3) if first == second else 0.0
            total += spread[first] @ (np.asarray(mix.correlation)[rows, columns] - independent) @ spread[second].T
    return total
