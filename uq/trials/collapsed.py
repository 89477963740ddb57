"""Trials without samples: the Gram sums themselves are drawn, so nothing grows with the length of the run.

A trial depends on the gyro's white noise through some 150 sums over samples, whose mean and covariance are known
exactly (:mod:`uq.gram_sums.gram_moments`). Their part linear in the noise is normal; their quadratic part is a sum over
all samples and taken as normal too, which is the only approximation. Given these sums, the load cell's white normal
noise acts on the right side of the normal equations as one normal vector with the covariance ``Σ Ωᵀ S Ω``.

Unlike other trials these are computed many at a time, the trials on the last axis: they are so small that only whole
vectors of them keep a processor busy (:mod:`uq.gram_sums.sum_equations`).

So few numbers make a trial (some 160, of which the load cell's and the constant errors matter most) that quasi-random
ones save most of the trials (:mod:`uq.sources.quasi_random`; ``python -m benchmarks.quasi_random``).
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

from identify.motion.trajectory import Motion
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import wrench
from identify.rigid_body.inertia import Body
from uq.files.document import ExperimentError
from uq.gram_sums import plain_solve, sum_equations
from uq.gram_sums.error_maps import OF_THE_GYRO, Columns, cell_map
from uq.gram_sums.gram_moments import covariance, distinct_products, mean
from uq.gram_sums.setup import Case, Estimator, cases_of
from uq.gram_sums.sums_over_samples import alphas_of, moments_of_signals
from uq.sources.constant_errors import CELL_CHANNELS, Errors, errors_of_cases, perturbed
from uq.sources.distributions import Normal
from uq.sources.draws import Mixing, block_key, constant_coordinates, constants_at, draw_constants, stream_number
from uq.sources.quasi_random import SobolPoints, sobol_points
from uq.sources.random_normals import normals_of_keys
from uq.sources.source import Source
from uq.trials.trial import TrialEstimates, valid_samples

REFUSED, INSTEAD = "the sums over samples cannot be drawn (collapsed)", "draw samples"


class CollapsedSetup(Pytree):
    """Everything that a collapsed trial needs besides its key: nothing in it grows with the number of samples."""

    r_cg: Float[Array, "3"]
    """True centre of gravity from Q, in B [m]."""
    sources: tuple[Source, ...]
    mixing: tuple[Mixing, ...]
    cases: tuple[Case, ...] = static_field()
    mean: Float[Array, "variants estimators kept"]
    """Each estimator's expected ``sum_equations.TRIAL_SUMS``; the first variant has no noise of the gyro."""
    root: Float[Array, "noisy estimators kept products"]
    """A square root of their joint covariance, for each variant but the first."""
    variant: Int[Array, " cases"]
    """Which variant acts in each case."""
    cell: Float[Array, "cases 6 6"]
    """Covariance of the load cell's white noise of one sample in each case; force before moment."""
    estimators: int = static_field()
    points: SobolPoints | None = None
    """Of quasi-random trials; see :func:`with_points`."""


def with_points(setup: CollapsedSetup, trials: int, seed: int) -> CollapsedSetup:
    """Return the set-up of quasi-random trials, as many as this."""
    gyro, cell = (any(s.white and s.of_gyro is of_gyro for s in setup.sources) for of_gyro in (True, False))
    numbers = 6 * setup.estimators * cell + constant_coordinates(setup.sources) + setup.root.shape[-1] * gyro
    return replace(setup, points=sobol_points(max(numbers, 1), trials, seed))


def collapse(
    motion: Motion,
    body: Body,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    mixing: Sequence[Mixing] = (),
    cases: Sequence[Case] | None = None,
) -> CollapsedSetup:
    """Return what collapsed trials need of a noise-free motion, in float64.

    Raises:
        ExperimentError: a source whose effect the sums' moments do not hold.
    """
    gyro = _check(sources, mixing)
    cases = tuple(cases or cases_of(sources))
    acting = [tuple(source.name for source in gyro if source.name in case.sources) for case in cases]
    variants = list(dict.fromkeys([(), *acting]))
    squares = {source.name: np.broadcast_to(np.square(np.asarray(source.sigma, float)), 3) for source in gyro}
    variances = np.array([sum((squares[name] for name in names), np.zeros(3)) for names in variants])
    white = [source for source in sources if source.white]
    means, roots = _means_and_roots(motion.omega, motion.alpha, motion.specific_force_cg, body,
                                    [e.taps for e in estimators], variances)  # fmt: skip
    places = _places_of_sums(len(estimators))
    return CollapsedSetup(
        body.r_cg_from_q, tuple(sources), tuple(mixing), cases,
        jax.device_put(np.asarray(means)[:, places]), jax.device_put(np.asarray(roots)[:, places]),
        jax.device_put(np.array([variants.index(names) for names in acting])),
        jax.device_put(np.array([_cell_covariance(white, mixing, case) for case in cases])), len(estimators),
    )  # fmt: skip


def _check(sources: Sequence[Source], mixing: Sequence[Mixing]) -> list[Source]:
    """The white noise of omega.

    Raises:
        ExperimentError: a source whose effect the sums' moments do not hold.
    """
    white = [source for source in sources if source.white]
    other = [source.name for source in white if not isinstance(source.shape, Normal)]
    columns = Columns.of(sources)
    coloured = [source.name for source in sources if source.noise and not source.white]
    more = perturbed(sources) & {*OF_THE_GYRO, "gyro_delay"} or columns.time or columns.motion
    if other or coloured or more:
        what = "a source changes more than offsets"
        if other or coloured:
            what = f"the noise of {', '.join(other or coloured)} is not {'normal' if other else 'white'}"
        raise ExperimentError(f"{REFUSED}, since {what}: {INSTEAD}")
    gyro = [source for source in white if source.of_gyro]
    if any(set(mix.names) & {source.name for source in gyro} for mix in mixing):
        raise ExperimentError(f"{REFUSED}, since the gyro's noise is correlated: {INSTEAD}")
    return gyro


@jax.jit
def _means_and_roots(
    omega: Array, alpha: Array, specific_force: Array, body: Body, taps: list[Array], variances: Array
) -> tuple[Array, Array]:
    """Expected sums for each variance of omega's noise, and roots of their covariance for all but the first."""
    true = jax.vmap(wrench, in_axes=(None, 1, 1, 1), out_axes=1)(body, omega, alpha, specific_force)
    signals = jnp.concatenate([omega, alphas_of(omega, taps), *true])
    estimators = [Estimator("", differentiator) for differentiator in taps]
    moments = moments_of_signals(signals, jnp.asarray(valid_samples(omega.shape[1], estimators)), taps)
    first = np.array(list(distinct_products(len(taps)).values()))

    def root(variance):
        matrix = covariance(moments, variance)[first[:, None], first]
        scale = jnp.sqrt(jnp.diag(matrix))
        inverse = jnp.where(scale > 0, 1 / jnp.where(scale > 0, scale, 1), 0)
        values, vectors = jnp.linalg.eigh(matrix * jnp.outer(inverse, inverse))
        return scale[:, None] * vectors * jnp.sqrt(jnp.maximum(values, 0))[None]

    means = jax.vmap(lambda variance: mean(moments, variance)[first])(variances)
    return means, jax.lax.map(root, variances[1:])


def _cell_covariance(white: Sequence[Source], mixing: Sequence[Mixing], case: Case) -> Float[np.ndarray, "6 6"]:
    """The covariance of what the case's sources add to one sample of force and moment."""
    active = [source for source in white if not source.of_gyro and source.name in case.sources]
    total = np.zeros((6, 6))
    spreads = {s.name: np.eye(6, 3, -CELL_CHANNELS[s.target]) * np.asarray(s.sigma)[None] for s in active}
    for source in active:
        total += spreads[source.name] @ spreads[source.name].T
    for mix in mixing:
        ends = np.cumsum(mix.axes)
        places = [(name, slice(end - size, end)) for name, size, end in zip(mix.names, mix.axes, ends, strict=True)]
        members = [(spreads[name], rows) for name, rows in places if name in spreads]
        for first, rows in members:
            for second, columns in members:
                correlation = np.asarray(mix.correlation)[rows, columns]
                identity = np.eye(3) if rows == columns else np.zeros((3, 3))
                total += first @ (correlation - identity) @ second.T
    return total


def collapsed_trials(setup: CollapsedSetup, key: Key[Array, ""], indices: Int[Array, " trials"]) -> TrialEstimates:
    """Run many trials at a time; the result has them on the leading axis."""
    draws = _draw(setup, key, indices)
    quiet = jnp.broadcast_to(setup.mean[:1, ..., None], (1, *setup.mean.shape[1:], len(indices)))
    sums = jnp.concatenate([quiet, setup.mean[1:, ..., None] + setup.root @ draws.gyro])
    inertia = jnp.zeros((setup.estimators, len(setup.cases), 6, len(indices)))
    ok = jnp.zeros((setup.estimators, len(setup.cases), len(indices)), bool)
    for kind, members in _kinds(setup).items():
        numbers, cases = (grid.ravel() for grid in np.meshgrid(range(setup.estimators), members, indexing="ij"))
        estimates = _estimates(setup, draws, sums, kind, (numbers, cases))
        inertia, ok = inertia.at[numbers, cases].set(estimates[0]), ok.at[numbers, cases].set(estimates[1])
    return TrialEstimates(jnp.moveaxis(inertia, -1, 0), jnp.moveaxis(ok, -1, 0))


class _Draws(NamedTuple):
    """The draws of trials, the trials on the last axis."""

    errors: Errors
    """Of each case."""
    gyro: Float[Array, "products *trials"]
    """Standard normal numbers for the sums."""
    cell: Float[Array, "estimators 6 *trials"]
    """The same for the right sides."""


def _draw(setup: CollapsedSetup, key: Key[Array, ""], indices: Int[Array, " trials"]) -> _Draws:
    if setup.points is not None:
        return _draw_at(setup, jax.vmap(setup.points.of_trial, out_axes=-1)(indices))

    def errors(index):
        return _errors(setup, draw_constants(setup.sources, setup.mixing, key, index, float))

    white = [source for source in setup.sources if source.white]
    normal = []
    for of_gyro, shape in ((True, setup.root.shape[-1:]), (False, (setup.estimators, 6))):
        first = [source for source in white if source.of_gyro is of_gyro][:1]
        keys = [jax.vmap(lambda i, s=s: block_key(stream_number(s.name), key, i, 0))(indices) for s in first]
        drawn = normals_of_keys(keys[0], math.prod(shape)) if keys else jnp.zeros((math.prod(shape), len(indices)))
        normal.append(drawn.reshape(*shape, -1))
    return _Draws(jax.vmap(errors, out_axes=-1)(indices), *normal)


def _errors(setup: CollapsedSetup, draws: dict[str, Array]) -> Errors:
    return errors_of_cases(setup.sources, draws, [case.sources for case in setup.cases])


def _draw_at(setup: CollapsedSetup, points: Float[Array, "coordinates trials"]) -> _Draws:
    """The draws at points of the unit cube; what matters most takes the first coordinates, which are the most even."""
    sizes = (6 * setup.estimators, constant_coordinates(setup.sources), setup.root.shape[-1])
    acts = [any(s.white and s.of_gyro is of_gyro for s in setup.sources) for of_gyro in (False, True)]
    on = (acts[0], True, acts[1])
    ends = np.cumsum([size * acting for size, acting in zip(sizes, on, strict=True)])
    cell, constant, gyro = (
        points[end - size * acting : end] for end, size, acting in zip(ends, sizes, on, strict=True)
    )
    cell, gyro = (
        jax.scipy.special.ndtri(part) if acting else jnp.zeros((size, points.shape[1]))
        for part, size, acting in ((cell, sizes[0], acts[0]), (gyro, sizes[2], acts[1]))
    )
    errors = lambda point: _errors(setup, constants_at(setup.sources, setup.mixing, point))  # noqa: E731
    return _Draws(
        jax.vmap(errors, in_axes=-1, out_axes=-1)(constant),
        gyro[::-1],  # the last columns of the root are its largest
        cell.reshape(setup.estimators, 6, -1),
    )


class _Kind(NamedTuple):
    """What a group of cases has in common: as little as possible is then computed trial by trial."""

    moving: bool
    """The normal matrix differs from trial to trial, by errors of the gyro."""
    cell: bool
    """The load cell's white noise may act; true for every case where the normal matrix is fixed: it costs little."""
    noisy: bool
    """The covariance of that noise differs, by errors of the centre of gravity."""


def _kinds(setup: CollapsedSetup) -> dict[_Kind, list[int]]:
    kinds: dict[_Kind, list[int]] = {}
    for number, case in enumerate(setup.cases):
        acting = [source for source in setup.sources if source.name in case.sources]
        moving = any(source.of_gyro for source in acting)
        noisy = any(s.white for s in acting) and "r_cg" in perturbed(acting)
        cell = any(s.white and not s.of_gyro for s in (acting if moving else setup.sources))
        kinds.setdefault(_Kind(moving, cell, moving or noisy), []).append(number)
    return kinds


def _estimates(setup: CollapsedSetup, draws: _Draws, sums: Array, kind: _Kind, pairs: tuple[np.ndarray, np.ndarray]):
    """Some estimators' estimates of some cases of a kind, (pairs, 6, trials), and which could be solved.

    In three loops over the pairs, since the compiler would compute again in each result what it can fuse into one.
    """
    sums_of_pairs = jax.lax.map(lambda pair: _sums_of_case(setup, draws, sums, kind, *pair), pairs)
    equations = jax.lax.map(lambda arguments: _equations(setup, draws, kind, *arguments), (sums_of_pairs, *pairs))
    return jax.lax.map(lambda arguments: _solved(draws, kind, *arguments), (*equations, pairs[0]))


def _sums_of_case(setup: CollapsedSetup, draws: _Draws, sums: Array, kind: _Kind, number: Array, case: Array) -> dict:
    """The sums that the equations need."""
    errors = jax.tree.map(lambda leaf: leaf[case], draws.errors)
    rows = sums[setup.variant[case], number] if kind.moving else setup.mean[0, number][:, None]
    case_sums: dict = dict(zip(sum_equations.TRIAL_SUMS, rows, strict=True))
    if perturbed(setup.sources) & {"cell_scale", "cell_misalignment", "cell_cross_talk"}:
        case_sums |= _sensed(case_sums, jax.vmap(cell_map, in_axes=-1, out_axes=-1)(errors))
    case_sums |= sum_equations.residual_sums(case_sums, setup.r_cg[:, None] + errors.r_cg, errors.cell_bias)
    right_sums = [(*sum_equations.PHI[k], y) for k in sum_equations.OF_OMEGA_R for y in sum_equations.RESIDUAL]
    if not kind.moving:
        return {w: case_sums[w] for w in (*sum_equations.MATRIX_SUMS, *right_sums)}
    powers = sum_equations.powers_of(errors.gyro_bias)
    return {w: sum_equations.shifted(case_sums, powers, w) for w in (*sum_equations.MATRIX_SUMS, *right_sums)}


def _equations(setup: CollapsedSetup, draws: _Draws, kind: _Kind, case_sums: dict, number: Array, case: Array):
    """Normal matrix, its noise's covariance where the load cell's acts, and right side."""
    noise = {}
    if kind.cell:
        at = setup.r_cg[:, None] + (draws.errors.r_cg[case] if kind.noisy else 0.0)
        weight = sum_equations.residual_covariance(setup.cell[case][:, :, None], at)
        noise = sum_equations.weighted_matrix(case_sums, weight)
    return sum_equations.normal_matrix(case_sums), noise, sum_equations.right_side(case_sums)


def _solved(draws: _Draws, kind: _Kind, normal: dict, covariance: dict, right: list, number: Array):
    if kind.cell:
        noise = plain_solve.times_root(covariance, draws.cell[number])
        right = [exact + error for exact, error in zip(right, noise, strict=True)]
    solution, ok = plain_solve.solve(normal, right)
    inertia = jnp.stack(solution)
    ok = ok & jnp.all(jnp.isfinite(inertia), axis=0)
    return jnp.where(ok[None], inertia, jnp.nan), ok


def _places_of_sums(estimators: int) -> np.ndarray:
    """Where ``sum_equations.TRIAL_SUMS`` of each estimator stand among the distinct products of all."""
    place = {factors: k for k, factors in enumerate(distinct_products(estimators))}

    def row(factor, number):
        return factor if factor < 3 else factor + 3 * number if factor < 6 else factor - 3 + 3 * estimators

    return np.array(
        [[place[tuple(row(f, k) for f in factors)] for factors in sum_equations.TRIAL_SUMS] for k in range(estimators)]
    )


def _sensed(sums: dict, cell: Float[Array, "6 6 trials"]) -> dict:
    """The sums with the wrench, as the load cell sees it."""
    return {
        (*phi, 6 + row): plain_solve.total(cell[row, k] * sums[(*phi, 6 + k)] for k in range(6))
        for phi in sum_equations.PHI
        for row in range(6)
    }
