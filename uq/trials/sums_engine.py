"""Trials without samples: the Gram sums themselves are drawn, so that nothing in a trial grows with the run's length.

A trial depends on the gyro's noise through sums over samples. Their expectation is exact, trial by trial, from the sums
of the true motion under the trial's constant errors; what they fluctuate by is drawn about the expected errors, with
the covariance of :mod:`uq.gram_sums.run_moments`, and mapped by the errors as the sums are. The fluctuations are taken
as normal. Given these sums, the load cell's noise acts on the right side of the normal equations as one normal vector a
source, with the covariance ``Σ Ωᵀ S Ω``; coloured noise likewise, with the regressor behind its filter.

Each source of noise has draws of its own, which every case and every estimator in which it acts shares. So few numbers
make a trial that quasi-random ones save most of the trials (:mod:`uq.sources.quasi_random`).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Key

from identify.estimators.gram import solve_normal
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from uq.gram_sums.case_equations import (
    OF_OMEGA_R,
    Equations,
    FeatureSums,
    NoiseExpectation,
    equations_of,
    feature_map,
    noise_of_right_side,
    sums_by_axes,
    symmetric,
    times,
    weighted_sums,
)
from uq.gram_sums.error_maps import Columns, Platform, gyro_map
from uq.gram_sums.setup import Case
from uq.sources.constant_errors import Errors, errors_of_cases, no_errors, perturbed
from uq.sources.draws import Mixing, block_key, constant_coordinates, constants_at, draw_constants, stream_number
from uq.sources.quasi_random import SobolPoints, sobol_points
from uq.sources.random_normals import normals_of_keys
from uq.sources.source import Source
from uq.trials.trial import TrialEstimates

CELL_MAPS = frozenset(
    {"cell_scale", "cell_misalignment", "cell_cross_talk", "cell_drift", "gravity", "r_cg_from_omb", "tilt",
     "displaced_air", "entrained_air"}
)  # fmt: skip
"""Errors that map the wrench."""


class GyroStream(Pytree):
    """What a source of the gyro's noise makes the sums of a case fluctuate by."""

    name: str = static_field()
    cases: tuple[bool, ...] = static_field()
    """Whether it acts, case by case."""
    root: Float[Array, "estimators 247 rank"]
    """Square root of the covariance of the features' Gram matrix (169 entries) and their sums with the wrench (78)."""


class CellStream(Pytree):
    """Noise of the load cell that is drawn together: of a source, or of several that are correlated."""

    name: str = static_field()
    white: Float[Array, "cases 6 6"]
    """Covariance of its white part at one sample, force before moment."""
    coloured: tuple[tuple[Float[Array, "cases 6 6"], Float[Array, "estimators elements elements"]], ...]
    """Covariances of the white noises that drive its other parts; the elements' Gram matrix behind each filter."""


class SumsEngine(Pytree):
    """Everything that a trial on sums needs besides its key."""

    body: Body
    platform: Platform
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    cases: tuple[Case, ...] = static_field()
    columns: Columns = static_field()
    gram: Float[Array, "delays estimators elements elements"]
    """Noise-free sums of the elements at each node of the delay."""
    wrench: Float[Array, "delays estimators elements columns"]
    delay_weights: Float[Array, "delays delays"]
    """Coefficients of the powers of the delay, in parts of ``reach``, in the weight of each node."""
    middle: Float[Array, ""]
    """Delay in the middle of the nodes' range [s]."""
    reach: Float[Array, ""]
    """Half of the nodes' range of delays [s]."""
    expectation: NoiseExpectation
    """What the gyro's noise adds to expected sums, (cases, estimators, …)."""
    gyro: tuple[GyroStream, ...]
    cell: tuple[CellStream, ...]
    points: SobolPoints | None = None

    @property
    def estimators(self) -> int:
        """Number of estimators."""
        return self.gram.shape[1]


class _Draws(NamedTuple):
    """The draws of trials, the trials on the last axis."""

    errors: Mapping[str, Float[Array, "cases *shape trials"]]
    """Fields of :class:`uq.sources.constant_errors.Errors` that some source sets, case by case."""
    gyro: tuple[Float[Array, "estimators 247 trials"], ...]
    """Fluctuations of the sums by each stream of the gyro's noise."""
    cell: tuple[Float[Array, "6 trials"], ...]
    """Standard normal numbers of each stream of the load cell's noise."""
    trials: int
    """Number of trials."""


def with_points(engine: SumsEngine, trials: int, seed: int) -> SumsEngine:
    """Return the engine of quasi-random trials, as many as this."""
    normal = 6 * len(engine.cell) + sum(stream.root.shape[-1] for stream in engine.gyro)
    return replace(engine, points=sobol_points(max(normal + constant_coordinates(engine.sources), 1), trials, seed))


def sums_trials(engine: SumsEngine, key: Key[Array, ""], indices: Int[Array, " trials"]) -> TrialEstimates:
    """Run many trials at a time; the result has them on the leading axis."""
    draws = _draw(engine, key, indices)
    order, parts = [], []
    for moving in (True, False):
        members = [k for k, case in enumerate(engine.cases) if _moves(engine, case) is moving]
        order += members
        if members:
            parts.append(
                jax.lax.map(lambda k, moving=moving: _case(engine, draws, k, moving=moving), np.array(members))
            )
    inertia, ok = (jnp.concatenate(leaves)[np.argsort(order)] for leaves in zip(*parts, strict=True))
    return TrialEstimates(inertia.transpose(3, 1, 0, 2), ok.transpose(2, 1, 0))


def _moves(engine: SumsEngine, case: Case) -> bool:
    """Return whether the gyro errs in a case; else the normal matrix is the same in all trials, and computed once."""
    return any(source.of_gyro for source in engine.sources if source.name in case.sources)


def _draw(engine: SumsEngine, key: Key[Array, ""], indices: Int[Array, " trials"]) -> _Draws:
    sets, fields = [case.sources for case in engine.cases], sorted(perturbed(engine.sources))
    sizes = [6] * len(engine.cell), [stream.root.shape[-1] for stream in engine.gyro]

    def errors(draws: dict[str, Array]) -> dict[str, Array]:
        errors = errors_of_cases(engine.sources, draws, sets)
        return {field: getattr(errors, field) for field in fields}

    if engine.points is None:
        names = [*(stream.name for stream in engine.cell), *(stream.name for stream in engine.gyro)]
        keys = [jax.vmap(lambda i, n=n: block_key(stream_number(n), key, i, 0))(indices) for n in names]
        numbers = [normals_of_keys(*drawn) for drawn in zip(keys, [*sizes[0], *sizes[1]], strict=True)]
        constants = jax.vmap(lambda i: draw_constants(engine.sources, engine.mixing, key, i, float), out_axes=-1)(
            indices
        )
    else:  # what matters most takes the first coordinates, which are the most even
        point = jax.vmap(engine.points.of_trial, out_axes=-1)(indices)
        parts = jnp.split(point, np.cumsum([*sizes[0], constant_coordinates(engine.sources), *sizes[1]])[:-1])
        uniform = parts.pop(len(engine.cell))
        numbers = [jax.scipy.special.ndtri(part) for part in parts]
        constants = jax.vmap(lambda at: constants_at(engine.sources, engine.mixing, at), in_axes=-1, out_axes=-1)(
            uniform
        )
    cell, gyro = numbers[: len(engine.cell)], numbers[len(engine.cell) :]
    return _Draws(
        jax.vmap(errors, in_axes=-1, out_axes=-1, axis_size=len(indices))(constants),
        tuple(stream.root @ normal for stream, normal in zip(engine.gyro, gyro, strict=True)),
        tuple(cell),
        len(indices),
    )


def _case(
    engine: SumsEngine, draws: _Draws, case: Int[Array, ""], *, moving: bool
) -> tuple[Float[Array, "estimators 6 trials"], Bool[Array, "estimators trials"]]:
    """Return the estimates of one case, and which of them could be solved."""
    drawn = {field: values[case] for field, values in draws.errors.items()}
    errors, count = _no_errors()._replace(**drawn), draws.trials
    of_gyro = errors if moving else _no_errors()
    features = _features_of(engine, of_gyro)
    cell = _cell_map(engine, drawn)
    r_cg = engine.body.r_cg_from_q[:, None] + errors.r_cg
    weights = engine.delay_weights @ _powers((of_gyro.gyro_delay - engine.middle) / engine.reach, len(engine.gram))

    def estimator(k: Int[Array, ""]) -> tuple[Array, Array]:
        sums = FeatureSums(
            *(jnp.moveaxis(jnp.tensordot(weights, x[:, k], (0, 0)), 0, -1) for x in (engine.gram, engine.wrench))
        )
        if moving and engine.gyro:
            sums = _fluctuating(engine, draws, sums, case, k)
        noise = jax.tree.map(lambda leaf: leaf[case, k], engine.expectation)
        equations = equations_of(sums, features, noise, cell, errors.cell_bias, r_cg)
        right = equations.right
        if engine.cell:
            covariances = [_cell_covariance(stream, equations, features, case, k, r_cg) for stream in engine.cell]
            noise = noise_of_right_side(jnp.stack(covariances, axis=1), jnp.stack(draws.cell, axis=1))
            right = right + jnp.sum(noise, axis=1)
        estimate = solve_normal(symmetric(jnp.sum(equations.by_axes[:3], axis=0)), right)
        return jnp.broadcast_to(estimate.inertia, (6, count)), jnp.broadcast_to(estimate.ok, (count,))

    return jax.lax.map(estimator, jnp.arange(engine.estimators))


def _cell_covariance(
    stream: CellStream, equations: Equations, features: Array, case: Array, estimator: Array, r_cg: Array
) -> Float[Array, "21 #trials"]:
    """Return the covariance of what a stream of the load cell's noise adds to the right side."""
    covariance = weighted_sums(equations.by_axes, stream.white[case], r_cg)
    for driving, behind in stream.coloured:
        of_omega_r = features[OF_OMEGA_R]
        mapped = times(of_omega_r, behind[estimator][:, :, None])
        by_axes = sums_by_axes(times(jax.lax.optimization_barrier(mapped), of_omega_r.swapaxes(0, 1)))
        covariance = covariance + weighted_sums(by_axes, driving[case], r_cg)
    return covariance


def _no_errors() -> Errors:
    """Return no errors, the same in all trials."""
    return Errors(*(x[..., None] for x in no_errors()))


def _features_of(engine: SumsEngine, errors: Errors) -> Float[Array, "13 elements #trials"]:
    if perturbed(engine.sources) & {"gyro_misalignment", "gyro_scale"}:
        given = (errors.gyro_misalignment, errors.gyro_scale)
        turned = lambda turn, scale: gyro_map(no_errors()._replace(gyro_misalignment=turn, gyro_scale=scale))  # noqa: E731
        gyro = jax.vmap(turned, in_axes=-1, out_axes=-1)(*map(jnp.asarray, given))
    else:
        gyro = jnp.eye(3)[:, :, None]
    drifts = "gyro_drift" in perturbed(engine.sources)
    return feature_map(gyro, jnp.asarray(errors.gyro_bias), jnp.asarray(errors.gyro_drift) if drifts else None)


def _cell_map(engine: SumsEngine, moving: Mapping[str, Array]) -> Float[Array, "6 columns trials"] | None:
    if not perturbed(engine.sources) & CELL_MAPS:
        return None
    mapped = lambda errors: engine.columns.map(engine.body, engine.platform, no_errors()._replace(**errors))  # noqa: E731
    return jax.vmap(mapped, in_axes=-1, out_axes=-1)({field: moving[field] for field in moving if field in CELL_MAPS})


def _powers(x: Float[Array, " trials"], count: int) -> Float[Array, "powers trials"]:
    return jnp.stack([x**k for k in range(count)])


def _fluctuating(engine: SumsEngine, draws: _Draws, sums: FeatureSums, case: Array, estimator: Array) -> FeatureSums:
    """Add what the gyro's noise of a case makes the sums fluctuate by."""
    total: Any = 0.0
    for stream, fluctuation in zip(engine.gyro, draws.gyro, strict=True):
        acts = jnp.array(stream.cases, float)[case]
        total = total + acts * fluctuation[estimator]
    gram, wrench = total[:169].reshape(13, 13, -1), total[169:].reshape(13, 6, -1)
    time = len(sums.gram) - 13  # the elements that hold time have no noise
    gram = _with_gap(_with_gap(gram, time).swapaxes(0, 1), time)
    wrench = jnp.pad(_with_gap(wrench, time), ((0, 0), (0, sums.wrench.shape[1] - 6), (0, 0)))
    return FeatureSums(sums.gram + gram, sums.wrench + wrench)


def _with_gap(rows: Float[Array, "13 k trials"], gap: int) -> Float[Array, "elements k trials"]:
    return jnp.concatenate([rows[:10], jnp.zeros((gap, *rows.shape[1:])), rows[10:]]) if gap else rows
