"""Propagation of distributions through a measurement model by an adaptive Monte Carlo (JCGM 101:2008, clause 7)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.display.reporting import Result
from identify.floating_point import check_precision
from identify.pytree import Pytree, static_field
from uq.analysis.propagation.law_of_propagation import Model
from uq.monte_carlo.coverage.adaptive_procedure import Blocks, Goal, Stability, not_stable
from uq.monte_carlo.coverage.coverage_intervals import CoverageInterval, Value, shortest_interval, symmetric_interval
from uq.monte_carlo.coverage.coverage_regions import covariance_of
from uq.monte_carlo.trials.trial_loop import TrialLoop, finite_trials
from uq.sources.distributions import Distribution
from uq.sources.draws import stream_key, stream_number
from uq.sources.quasi_random import BITS, Points, SobolPoints, coordinates_of, sobol_points, values_at

LEAST_EVEN = 8192
"""Quasi-random trials in a block at least: the power of two next to the 10,000 of 7.9.4 b."""


@dataclass(frozen=True, repr=False)
class Propagation(Result):
    """A measurand by the propagation of distributions (JCGM 101, 7.6 and 7.7).

    Example: ``propagate_distributions(lambda x: x["a"] ** 2, {"a": Normal(1.0, 0.1)}).to_frame()``.
    """

    trials: int
    seed: int
    estimate: np.ndarray
    """Average of the trials, of the measurand's shape."""
    covariance: np.ndarray
    """Covariance of the measurand's m components, flattened, (m, m)."""
    symmetric: CoverageInterval
    shortest: CoverageInterval
    stability: Stability
    warnings: tuple[str, ...]
    draws: Float[np.ndarray, "trials *outputs"] = field(compare=False)

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard deviation of the trials, of the measurand's shape."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(self.estimate.shape))

    def records(self) -> list[dict[str, Any]]:
        """Return the same as numbers, in the measurand's unit."""
        columns = {
            "estimate": self.estimate, "standard_uncertainty": self.standard_uncertainty,
            "low": self.symmetric.low, "high": self.symmetric.high,
            "shortest_low": self.shortest.low, "shortest_high": self.shortest.high,
            "tolerance": self.stability.tolerance,
        }  # fmt: skip
        rows = zip(*map(np.ravel, columns.values()), strict=True)
        return [dict(zip(columns, row, strict=True)) for row in rows]


def propagate_distributions(
    model: Model,
    inputs: Mapping[str, Distribution],
    *,
    digits: int = 2,
    tolerance: Value = None,
    probability: float = 0.95,
    joint: bool = False,
    seed: int = 0,
    points: Points = "quasi-random",
    block: int | None = None,
    most_trials: int = 10_000_000,
) -> Propagation:
    """Propagate the inputs' distributions through a model by an adaptive Monte Carlo (JCGM 101, 7.9).

    Each block of quasi-random trials is the sequence under a shift of its own (:mod:`uq.sources.quasi_random`), so that
    the scatter over the blocks, by which the procedure stops, is that of independent figures, as of random trials.

    Args:
        model: the measurement model, JAX on a dict of arrays, one trial.
        inputs: distributions by name; correlated coordinates belong to one of them.
        digits: significant digits of the standard uncertainty that are to be stable.
        tolerance: the numerical tolerance instead, in the output's unit; one figure or one an output.
        probability: coverage probability.
        joint: watch λ_max and k_p of several outputs too (JCGM 102, 7.8).
        seed: seed of every draw.
        points: ``"quasi-random"``; or ``"random"``, where a draw depends on seed, input's name and number of
            block alone, so that another input changes none.
        block: trials in a block; None for 10,000, or 100 / (1 - p) if that is more (7.9.4 b); of quasi-random trials,
            which are most even so, a power of two: 8,192, or the next after 100 / (1 - p).
        most_trials: upper limit of the trials; where it stops the procedure, the result has a warning.

    Raises:
        ValueError: no input, or a goal that cannot be.
    """
    if not inputs:
        raise ValueError("Argument `inputs` must hold at least one input, but is empty.")
    goal = Goal(digits, tolerance, probability, joint)
    even = 2 ** (max(LEAST_EVEN, goal.least_block) - 1).bit_length()
    block = block or (even if points == "quasi-random" else max(10_000, goal.least_block))
    warned = check_precision("float64")
    net = None if points == "random" else sobol_points(coordinates_of(inputs), block, seed, replicates=1)
    problem, blocks = _Problem(model, dict(sorted(inputs.items())), block, net), Blocks(goal)
    loop = TrialLoop(_blocks, problem, seed, devices=jax.devices()[:1], segment=1)  # a block at a time, until stable
    while not loop.count or (loop.count + 1) * block <= most_trials:
        loop.reach(loop.count + 1)
        blocks.add(loop.results(loop.count, loop.count - 1).reshape(block, -1))
        if blocks.stability().stable:
            break
    draws, stability = np.concatenate(loop.results(loop.count)), blocks.stability()
    finite, failed = finite_trials(draws)
    notes = [] if stability.stable else [not_stable(stability, len(draws))]
    notes += [f"{failed} of {len(draws):,} trials are not finite and are left out."] if failed else []
    return Propagation(
        trials=len(draws), seed=seed, estimate=np.asarray(finite.mean(0)),
        covariance=covariance_of(finite.reshape(len(finite), -1)), symmetric=symmetric_interval(finite, probability),
        shortest=shortest_interval(finite, probability), stability=stability,
        warnings=(*warned, *notes), draws=draws,
    )  # fmt: skip


class _Problem(Pytree):
    """Data of a block of trials besides its number."""

    model: Model = static_field()
    inputs: Mapping[str, Distribution]
    size: int = static_field()
    """Trials in a block."""
    net: SobolPoints | None
    """Points of quasi-random trials, which each block shifts anew; None: trials are random."""


def _blocks(problem: _Problem, key: Array, numbers: Array) -> Float[Array, "blocks trials *outputs"]:
    def draw(number: Array, name: str, given: Distribution) -> Array:
        stream = stream_key(key, stream_number(name), number)
        return given.draw(stream, (problem.size, *np.shape(given.mean)))

    def values(number: Array) -> dict[str, Array]:
        net = problem.net
        if net is None:
            return {name: draw(number, name, given) for name, given in problem.inputs.items()}
        # a random shift of Sobol's points makes the blocks independent of each other, each as even as the plain points
        bits = jax.random.bits(jax.random.fold_in(key, number), (net.coordinates,), np.uint32)
        at = lambda place: values_at(problem.inputs, net.of_place(place, bits >> (32 - BITS)))  # noqa: E731
        return jax.vmap(at)(jnp.arange(problem.size))

    def of_block(number: Array) -> Array:
        return jax.vmap(problem.model)(values(number))

    return jax.lax.map(of_block, numbers)
