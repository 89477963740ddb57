"""Trials without samples: the Gram sums themselves are drawn, so that nothing in a trial grows with the run's length.

A trial depends on the gyro's noise through sums over samples. Their expectation is exact, trial by trial, from the sums
of the true motion under the trial's constant errors; what they fluctuate by is drawn about the expected errors, with
the covariance of :mod:`uq.monte_carlo.gram_sums.noise_moments`, and mapped by the errors as the sums are. The
fluctuations count as normal. Given these sums, the load cell's noise acts on the right side of the normal equations as
one normal vector a source, with the covariance ``Σ Ωᵀ S Ω``; coloured noise likewise, with the regressor behind its
filter.

Each source of noise has draws of its own, which every case and every estimator in which it acts shares. So has the
product of the load cell's noise with the gyro's, whose noise stands in the regressor: a share of the variance that
neither source makes alone. So few numbers make a trial that quasi-random ones save most of the trials
(:mod:`uq.sources.quasi_random`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.least_squares.gram import solve_normal
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from uq.monte_carlo.gram_sums.case_equations import (
    OF_OMEGA_R,
    Equations,
    NoiseExpectation,
    equations_of,
    feature_map,
    noise_of_right_side,
    sums_by_axes,
    symmetric,
    times,
    weighted_sums,
)
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.gram_sums.error_maps import OF_THE_RIG, Platform, WrenchBasis, gyro_map
from uq.monte_carlo.gram_sums.run_sums import FeatureSums, RunSums
from uq.monte_carlo.trials.engine import Engine, Estimates
from uq.sources.constant_errors import Errors, errors_of_cases, no_errors, perturbed
from uq.sources.draws import Mixing, constant_coordinates, constant_key, constants_at, draw_constants, stream_number
from uq.sources.quasi_random import SobolPoints, sobol_points
from uq.sources.random_normals import normals_of_keys
from uq.sources.source import Source

CELL_MAPS = OF_THE_RIG | {"cell_scale", "cell_misalignment", "cell_cross_talk", "cell_drift"}
"""Errors that map the wrench."""
GYRO_MAPS = frozenset({"gyro_misalignment", "gyro_scale"})
"""Errors that map the angular velocity."""


class GyroStreams(Pytree):
    """Fluctuations of the sums by the gyro's noise: by each of its sources, and by the product of each two of them."""

    names: tuple[str, ...] = static_field()
    """Names of their random streams."""
    acts: Float[Array, "streams cases"]
    """1 where a stream acts, else 0."""
    roots: Float[Array, "streams estimators 247 rank"]
    """Square roots of the covariances of the features' Gram matrix (169 entries) and of their sums with the wrench."""


class ColouredNoise(Pytree):
    """Noise of the load cell behind one filter L: with white w that drives it, ``Ωᵀ L w = (Lᵀ Ω)ᵀ w``.

    So it acts as white noise does, on a regressor that is filtered backwards in time.
    """

    streams: tuple[int, ...] = static_field()
    """Numbers of the streams that have such noise."""
    driving: Float[Array, "cases 6 6 streams"]
    """Covariances of the white noises that drive the filter, force before moment."""
    behind: Float[Array, "estimators elements elements"]
    """Gram matrix of the elements behind the filter."""


class LoadCellStreams(Pytree):
    """Noise of the load cell, stream by stream: of one source each, or of several that are correlated."""

    names: tuple[str, ...] = static_field()
    white: Float[Array, "cases 6 6 streams"]
    """Covariance of the white part at one sample, force before moment."""
    coloured: tuple[ColouredNoise, ...]


class CrossedNoise(Pytree):
    """Correlates the load cell's noise between cases whose gyro noise differs.

    Numbers ``W₀ z₀ + Σ_g W_g z_g``, with ``W₀ W₀ᵀ + Σ_g W_g W_gᵀ = 1``, are standard normal in every case. Two cases
    share z₀, which the load cell's noise draws, and the z_g of those sources of the gyro's noise that act in both.
    """

    names: tuple[str, ...] = static_field()
    """Names of the random streams: each source of the gyro's noise with each stream of the load cell's."""
    alone: Float[Array, "cases estimators 6 6 streams"]
    """Weights W₀ of the numbers that a stream of the load cell's noise draws alone."""
    with_gyro: Float[Array, "cases estimators gyro 6 6 streams"]
    """Weights W_g of the numbers that it draws with each source of the gyro's noise."""


class SumsEngine(Engine):
    """An experiment on one trajectory as sums over its samples, and what noise makes of them."""

    body: Body
    platform: Platform
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    basis: WrenchBasis = static_field()
    sums: RunSums
    """Sums of all estimators, without noise."""
    expectation: NoiseExpectation
    """Additions of the gyro's noise to expected sums, (cases, estimators, …)."""
    gyro: GyroStreams
    cell: LoadCellStreams
    crossed: CrossedNoise
    segment = 5000
    """A fraction of a second."""
    points: SobolPoints | None = None
    """Points of quasi-random trials; None: they are random."""

    def batch(self, device: jax.Device) -> int:
        """Return as many trials as fill a processor's vector units and stay in its cache."""
        return 500

    def run(self, key: Key[Array, ""], indices: Int[Array, " trials"]) -> Estimates:
        """Return the estimates of trials, which stand side by side on the last axis of all that is computed."""
        draws = _draw(self, key, indices)
        order, parts = [], []
        # two loops: in cases without errors of the gyro the normal matrix is the same in all trials, and is factored
        # once
        for moving in (True, False):
            members = [k for k, case in enumerate(self.cases) if _moves(self, case) is moving]
            order += members
            if members:
                parts.append(jax.lax.map(partial(_case, self, draws, moving=moving), np.array(members)))
        return jnp.concatenate(parts)[np.argsort(order)].transpose(3, 1, 0, 2)


class _Draws(NamedTuple):
    """The draws of trials, the trials on the last axis."""

    errors: Mapping[str, Float[Array, "cases *shape trials"]]
    """Fields of :class:`uq.sources.constant_errors.Errors` that some source sets, case by case."""
    gyro: Float[Array, "streams estimators 247 trials"]
    """Fluctuations of the sums by each stream of the gyro's noise."""
    cell: Float[Array, "6 streams trials"]
    """Standard normal numbers of each stream of the load cell's noise."""
    crossed: Float[Array, "6 gyro*streams trials"]
    """Standard normal numbers of each of these streams with each source of the gyro's noise."""
    trials: int
    """Number of trials."""


def quasi_random(engine: SumsEngine, trials: int, seed: int) -> SumsEngine:
    """Return the engine with quasi-random trials, so many of them."""
    return replace(engine, points=sobol_points(max(sum(_coordinates(engine)), 1), trials, seed))


def _coordinates(engine: SumsEngine) -> tuple[int, int, int, int]:
    """Return how many numbers a trial draws: load cell's noise, constants, gyro's noise, product of both noises."""
    streams, *_, rank = engine.gyro.roots.shape
    cell, crossed = 6 * len(engine.cell.names), 6 * len(engine.crossed.names)
    return cell, constant_coordinates(engine.sources), streams * rank, crossed


def _moves(engine: SumsEngine, case: Case) -> bool:
    """Return whether the gyro errs in a case; else the normal matrix is the same in all trials, and computed once."""
    return any(source.of_gyro for source in engine.sources if source.name in case.sources)


def _draw(engine: SumsEngine, key: Key[Array, ""], indices: Int[Array, " trials"]) -> _Draws:
    sets, fields = [case.sources for case in engine.cases], sorted(perturbed(engine.sources))
    rank = engine.gyro.roots.shape[-1]

    def errors(draws: dict[str, Array]) -> dict[str, Array]:
        errors = errors_of_cases(engine.sources, draws, sets)
        return {field: getattr(errors, field) for field in fields}

    if engine.points is None:
        names = engine.cell.names + engine.crossed.names
        cell, crossed = jnp.split(_normals(names, 6, key, indices), [len(engine.cell.names)], axis=1)
        gyro = _normals(engine.gyro.names, rank, key, indices)
        constants = jax.vmap(
            lambda i: draw_constants(engine.sources, engine.mixing, key, i, jnp.result_type(float)), out_axes=-1
        )(indices)
    else:  # what matters most takes the first coordinates, which are the most even
        point = jax.vmap(engine.points.of_trial, out_axes=-1)(indices)
        cell, uniform, gyro, crossed = jnp.split(
            point[: sum(_coordinates(engine))], np.cumsum(_coordinates(engine))[:-1]
        )
        # normal numbers by inversion, one coordinate each: Box and Muller's two would lose the points' evenness
        cell, gyro, crossed = (
            jax.scipy.special.ndtri(part).reshape(-1, size, len(indices)).swapaxes(0, 1)
            for part, size in ((cell, 6), (gyro, rank), (crossed, 6))
        )
        constants = jax.vmap(lambda at: constants_at(engine.sources, engine.mixing, at), in_axes=-1, out_axes=-1)(
            uniform
        )
    return _Draws(
        errors=jax.vmap(errors, in_axes=-1, out_axes=-1, axis_size=len(indices))(constants),
        gyro=jnp.einsum("serk,kst->sert", engine.gyro.roots, gyro), cell=cell, crossed=crossed, trials=len(indices),
    )  # fmt: skip


def _normals(
    names: Sequence[str], count: int, key: Key[Array, ""], indices: Int[Array, " trials"]
) -> Float[Array, "count streams trials"]:
    """Return standard normal numbers of each stream in each trial."""
    numbers = jnp.asarray([stream_number(name) for name in names], jnp.uint32)
    keys = jax.vmap(lambda number: jax.vmap(lambda i: constant_key(key, number, i))(indices))(numbers)
    return normals_of_keys(keys.ravel(), count).reshape(count, len(names), len(indices))


def _case(
    engine: SumsEngine, draws: _Draws, case: Int[Array, ""], *, moving: bool
) -> Float[Array, "estimators 6 trials"]:
    """Return the estimates of one case.

    In the order of the chain: errors map the sums; then the gyro's noise adds what it is expected to, which no error
    maps, for it arises behind the sensor's axes; last comes the load cell's noise, whose covariance depends on the
    regressor that all this has made.
    """
    drawn = {field: values[case] for field, values in draws.errors.items()}
    errors = _no_errors()._replace(**drawn)
    gyro_errors = errors if moving else _no_errors()
    gyro = _by_trial(gyro_map, drawn if moving else {}, GYRO_MAPS)
    drifts = "gyro_drift" in perturbed(engine.sources)
    features = feature_map(
        jnp.eye(3)[:, :, None] if gyro is None else gyro, jnp.asarray(gyro_errors.gyro_bias),
        jnp.asarray(gyro_errors.gyro_drift) if drifts else None,
    )  # fmt: skip
    cell = _by_trial(partial(engine.basis.map, engine.body, engine.platform), drawn, CELL_MAPS)
    r_cg = jnp.asarray(engine.body.r_cg_from_q)[:, None] + errors.r_cg

    def estimator(k: Int[Array, ""]) -> Float[Array, "6 trials"]:
        sums = engine.sums.of_estimator(k).at(gyro_errors.gyro_delay)
        if moving and engine.gyro.names:
            sums = _fluctuating(engine, draws, sums, case, k)
        noise = jax.tree.map(lambda leaf: leaf[case, k], engine.expectation)
        equations = equations_of(sums, features, noise, cell, errors.cell_bias, r_cg)
        right = equations.right
        if engine.cell.names:
            # given Ω, Ωᵀ e is normal with Σ Ωᵀ S Ω: six numbers stand for the noise of all samples. Last, since Ω is
            # by now as the gyro's errors and noise have made it
            covariance = _cell_covariance(engine.cell, equations, features, case, k, r_cg)
            normals = _cell_normals(engine, draws, case, k) if moving and engine.crossed.names else draws.cell
            right = right + jnp.sum(noise_of_right_side(covariance, normals), axis=1)
        estimate = solve_normal(symmetric(jnp.sum(equations.by_axes[:3], axis=0)), right)
        return jnp.broadcast_to(estimate.inertia, (6, draws.trials))

    return jax.lax.map(estimator, jnp.arange(engine.sums.gram.shape[1]))


def _cell_normals(engine: SumsEngine, draws: _Draws, case: Array, estimator: Array) -> Float[Array, "6 streams trials"]:
    """Return standard normal numbers of each stream, correlated between cases whose gyro noise differs."""
    alone, with_gyro = engine.crossed.alone[case, estimator], engine.crossed.with_gyro[case, estimator]
    numbers = draws.crossed.reshape(6, *with_gyro.shape[::3], draws.trials)
    return jnp.einsum("ijs,jst->ist", alone, draws.cell) + jnp.einsum("gijs,jgst->ist", with_gyro, numbers)


def _cell_covariance(
    cell: LoadCellStreams, equations: Equations, features: Array, case: Array, estimator: Array, r_cg: Array
) -> Float[Array, "21 streams #trials"]:
    """Return the covariance ``Σ Ωᵀ S Ω`` of what each stream of the load cell's noise adds to the right side ``Ωᵀ e``.

    It is exact given Ω. Coloured noise has the regressor behind its filter in Ω's place (:class:`ColouredNoise`).
    """

    def weighted(by_axes: Array, covariances: Array) -> Array:
        return weighted_sums(by_axes[:, :, None], covariances[case][..., None], r_cg[:, None])

    covariance = weighted(equations.by_axes, cell.white)
    for noise in cell.coloured:
        rows = features[OF_OMEGA_R]
        # Ωᵀ L w = (Lᵀ Ω)ᵀ w: white noise on a regressor behind the filter, whose sums the errors map by the same
        # congruence
        mapped = times(rows, noise.behind[estimator][:, :, None])
        by_axes = sums_by_axes(times(jax.lax.optimization_barrier(mapped), rows.swapaxes(0, 1)))
        covariance = covariance.at[:, np.array(noise.streams)].add(weighted(by_axes, noise.driving))
    return covariance


def _no_errors() -> Errors:
    """Return no errors, the same in all trials."""
    return Errors(*(x[..., None] for x in no_errors()))


def _by_trial(
    function: Callable[[Errors], Any], drawn: Mapping[str, Array], fields: frozenset[str]
) -> Float[Array, "rows columns trials"] | None:
    """Return a matrix that depends on these fields of the errors, trial by trial; None where none is drawn."""
    moving = {field: values for field, values in drawn.items() if field in fields}
    if not moving:
        return None
    return jax.vmap(lambda errors: function(no_errors()._replace(**errors)), in_axes=-1, out_axes=-1)(moving)


def _fluctuating(engine: SumsEngine, draws: _Draws, sums: FeatureSums, case: Array, estimator: Array) -> FeatureSums:
    """Add the fluctuations of the sums by the gyro's noise in a case.

    Before errors map the sums: ``T (S + δS) Tᵀ`` is what a trial by samples gives, but for products of the fluctuation
    with errors of scale and axes, for noise arises behind these.
    """
    # independent sources of noise add, and so does what each two of them make together
    total = jnp.tensordot(engine.gyro.acts[:, case], draws.gyro[:, estimator], 1)
    gram, wrench = total[:169].reshape(13, 13, -1), total[169:].reshape(13, 6, -1)
    time = len(sums.gram) - 13  # the elements that hold time have no noise
    gram = _with_gap(_with_gap(gram, time).swapaxes(0, 1), time)
    wrench = jnp.pad(_with_gap(wrench, time), ((0, 0), (0, sums.wrench.shape[1] - 6), (0, 0)))
    return FeatureSums(sums.gram + gram, sums.wrench + wrench)


def _with_gap(rows: Float[Array, "13 k trials"], gap: int) -> Float[Array, "elements k trials"]:
    return jnp.concatenate([rows[:10], jnp.zeros((gap, *rows.shape[1:])), rows[10:]]) if gap else rows
