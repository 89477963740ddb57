"""A model's outputs when some inputs keep their values and the others are redrawn, given the fixed ones.

Two independent draws X and X' of all inputs make a trial. An independent input is redrawn by taking its value from X'.
Correlated inputs are normal; they are redrawn from their conditional distribution by ``z' + G (z - z')``, with the
regression ``G`` on the fixed ones (conditioning by kriging: Journel and Huijbregts, Mining Geostatistics, 1978).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from identify.pytree import Pytree, static_field
from uq.monte_carlo.trials.trial_loop import RunTrials, all_trials
from uq.sources.distributions import Distribution, Normal
from uq.sources.draws import stream_key, stream_number
from uq.sources.quasi_random import Points, SobolPoints, coordinates_of, sobol_points, values_at

Values = dict[str, Array]
Model = Callable[[Values], Array]
Correlation = Mapping[tuple[str, str], float]
Listed = list[tuple[str, Distribution]]
"""Inputs in their order, which jit would take from a dict."""
AT_ONCE = 100_000
"""Evaluations of the model that are batched."""


class Joint(Pytree):
    """Correlated normal inputs."""

    names: tuple[str, ...] = static_field()
    matrix: Float[Array, "k k"]
    """Correlation matrix of the inputs."""
    root: Float[Array, "k k"]
    """``root @ root.T`` is the matrix."""


class Pair(NamedTuple):
    """Two independent draws of all inputs."""

    values: tuple[Values, Values]
    normals: tuple[Array, Array] | None
    """Two draws of the correlated inputs, standardised; None: no inputs are correlated."""


def correlated(inputs: Mapping[str, Distribution], correlation: Correlation | None) -> Joint | None:
    """Return the inputs that correlation coefficients join; None where there are none.

    Raises:
        ValueError: an input that is unknown or not scalar normal, or coefficients that no joint distribution has.
    """
    if not correlation:
        return None
    for name in (name for pair in correlation for name in pair):
        if name not in inputs:
            raise ValueError(f"Argument `correlation` must name inputs, but '{name}' is none of {', '.join(inputs)}.")
        if not isinstance(inputs[name], Normal) or np.shape(inputs[name].mean):
            raise ValueError(f"Argument `correlation` must be of scalar normal inputs, but '{name}' is not one.")
    names = tuple(name for name in inputs if any(name in pair for pair in correlation))
    matrix = np.eye(len(names))
    for (first, second), value in correlation.items():
        if first == second or not -1 <= value <= 1:
            raise ValueError(f"Argument `correlation` must be within −1 and 1, but of {first} and {second} is {value}.")
        i, j = names.index(first), names.index(second)
        matrix[i, j] = matrix[j, i] = value
    eigenvalues, eigenvectors = np.linalg.eigh(matrix)
    if eigenvalues[0] < -1e-9:
        raise ValueError(f"Argument `correlation` must have no negative eigenvalue, but has {eigenvalues[0]:.3g}.")
    return Joint(names, jnp.asarray(matrix), jnp.asarray(eigenvectors * np.sqrt(np.maximum(eigenvalues, 0))))


@dataclass(frozen=True)
class Redraws:
    """A model whose inputs are redrawn in each of some trials."""

    model: Model
    inputs: Mapping[str, Distribution]
    joint: Joint | None
    """Inputs that are correlated; None: there are none."""
    trials: int
    seed: int
    points: Points
    """Kind of points that the trials are drawn from."""

    def outputs(self, fixed: Bool[np.ndarray, "rows inputs"]) -> Float[np.ndarray, "trials rows outputs"]:
        """Return each trial's outputs, raveled, where each row keeps these inputs of the first draw."""
        return self._run(_outputs, fixed, ranks=0, evaluations=len(fixed))

    def walks(
        self, holds: Bool[np.ndarray, "players inputs"]
    ) -> tuple[Int[np.ndarray, "trials players"], Float[np.ndarray, "trials rows outputs"]]:
        """Return each trial's random order of the players, and the outputs as one player after the other is redrawn.

        The first of the players + 1 rows keeps all inputs, the last redraws all.
        """
        return self._run(_walks, holds, ranks=len(holds), evaluations=len(holds) + 1)

    def _run(self, run: RunTrials, rows: np.ndarray, *, ranks: int, evaluations: int) -> Any:
        """Run the trials, each of so many evaluations, with coordinates of the points for so many random ranks.

        On one device, since batches of LAPACK's on two of one processor wait for ever. Models may call it (eigenvalues,
        solutions of equations), and so do the regressions of correlated inputs.
        """
        net, coordinates = None, 2 * coordinates_of(self.inputs) + ranks
        if self.points == "quasi-random":
            net = sobol_points(coordinates, self.trials, self.seed)
        distributions = tuple(self.inputs.values())
        problem = _Redrawn(self.model, tuple(self.inputs), distributions, self.joint, jnp.asarray(rows), net)
        batch = max(1, min(self.trials, AT_ONCE // evaluations))
        return all_trials(
            run, problem, self.trials, self.seed, devices=jax.devices()[:1], batch=batch, segment=self.trials
        )


class _Redrawn(Pytree):
    """Data of a trial besides its number."""

    model: Model = static_field()
    names: tuple[str, ...] = static_field()
    distributions: tuple[Distribution, ...]
    joint: Joint | None
    rows: Bool[Array, "rows inputs"]
    """Mask of the inputs that each row keeps; with walks, the inputs that each player holds."""
    net: SobolPoints | None
    """Points of quasi-random trials; None: trials are random."""

    @property
    def inputs(self) -> Listed:
        """Names and distributions."""
        return list(zip(self.names, self.distributions, strict=True))


def _outputs(problem: _Redrawn, key: Array, indices: Array) -> Float[Array, "trials rows outputs"]:
    model, inputs, joint, fixed, net = problem.model, problem.inputs, problem.joint, problem.rows, problem.net
    gains = _gains(inputs, joint, fixed)

    def of_trial(trial):
        pair = _pair(inputs, joint, key, trial) if net is None else _pair_at(inputs, joint, net.of_trial(trial))
        return _evaluate(model, inputs, joint, pair, fixed, gains)

    return jax.vmap(of_trial)(indices)


def _walks(problem: _Redrawn, key: Array, indices: Array) -> tuple[Array, Array]:
    model, inputs, joint, holds, net = problem.model, problem.inputs, problem.joint, problem.rows, problem.net
    orders = jax.random.fold_in(key, stream_number("order of the players"))

    def of_trial(trial):
        if net is None:
            order = jax.random.permutation(jax.random.fold_in(orders, trial), len(holds))
            pair = _pair(inputs, joint, key, trial)
        else:
            point, ranks = jnp.split(net.of_trial(trial), [net.coordinates - len(holds)])
            order, pair = jnp.argsort(ranks), _pair_at(inputs, joint, point)
        redrawn = jnp.cumsum(holds[order], axis=0) > 0
        fixed = jnp.concatenate([jnp.ones((1, holds.shape[1]), bool), ~redrawn])
        return order, _evaluate(model, inputs, joint, pair, fixed, _gains(inputs, joint, fixed))

    return jax.vmap(of_trial)(indices)


def _gains(inputs: Listed, joint: Joint | None, fixed: Bool[Array, "rows inputs"]) -> Float[Array, "rows k k"] | None:
    """Regressions of the correlated inputs on the fixed ones, ``R m (m R m)⁺ m``; of a singular matrix too."""
    if joint is None:
        return None
    places = np.array([name in joint.names for name, _ in inputs])

    def gain(mask):
        inner = joint.matrix * mask[:, None] * mask[None]
        return joint.matrix @ jnp.linalg.pinv(inner, hermitian=True, rtol=1e-10)

    return jax.vmap(gain)(fixed[:, places].astype(joint.matrix.dtype))


def _pair(inputs: Listed, joint: Joint | None, key, trial) -> Pair:
    def key_of(name, copy):
        return jax.random.fold_in(stream_key(key, stream_number(name), trial), copy)

    def values(copy):
        return {name: given.draw(key_of(name, copy), np.shape(given.mean)) for name, given in inputs}

    def normals(joint, copy):
        return joint.root @ jnp.stack([jax.random.normal(key_of(name, copy), ()) for name in joint.names])

    return Pair((values(0), values(1)), None if joint is None else (normals(joint, 0), normals(joint, 1)))


def _pair_at(inputs: Listed, joint: Joint | None, point: Float[Array, " coordinates"]) -> Pair:
    first, second = jnp.split(point, 2)
    values = values_at(dict(inputs), first), values_at(dict(inputs), second)
    if joint is None:
        return Pair(values, None)
    standard = dict(inputs) | dict.fromkeys(joint.names, Normal(0.0, 1.0))

    def normals(half):
        drawn = values_at(standard, half)
        return joint.root @ jnp.stack([drawn[name] for name in joint.names])

    return Pair(values, (normals(first), normals(second)))


def _evaluate(model, inputs: Listed, joint: Joint | None, pair: Pair, fixed, gains) -> Float[Array, "rows outputs"]:
    given = dict(inputs)

    def of_row(row, gain):
        first, second = pair.values
        values = {name: jnp.where(row[k], first[name], second[name]) for k, name in enumerate(given)}
        if joint is not None and pair.normals is not None:
            z, other = pair.normals
            for name, redrawn in zip(joint.names, other + gain @ (z - other), strict=True):
                values[name] = given[name].mean + given[name].standard_deviation * redrawn
        return jnp.ravel(model(values))

    return jax.vmap(of_row)(fixed, gains)
