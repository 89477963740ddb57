"""Trials on sums in plain NumPy, many at a time, for the preset's errors.

The algorithm is that of :mod:`uq.monte_carlo.trials.sums_engine`.

The product's set-up is taken: sums of the noise-free run, what noise adds to their expectation, and the root of the
covariance of what they fluctuate by. What a trial does with them is written anew.
"""

from typing import NamedTuple

import jax
import numpy as np

from benchmarks.vectorised import mapped, solved
from uq.monte_carlo.trials.sums_engine import SumsEngine

BATCH = 1000
"""Trials at a time, which was fastest."""
PAIR = np.array([[max(i, j) * (max(i, j) + 1) // 2 + min(i, j) for j in range(9)] for i in range(9)])
"""Places in the lower triangle, row by row, of a symmetric matrix's numbers."""


class Draws(NamedTuple):
    """Normal numbers of trials."""

    constants: dict[str, np.ndarray]
    """Constant errors by source, (trials, 3), in SI."""
    gyro: np.ndarray
    """Of the gyro's noise, (trials, rank)."""
    cell: list[np.ndarray]
    """Of each stream of the load cell's noise, (trials, 6)."""
    crossed: list[np.ndarray]
    """Of each of them with the gyro's noise, likewise."""


def on_host(engine: SumsEngine) -> SumsEngine:
    """Return what is prepared, in NumPy."""
    return jax.tree.map(np.asarray, engine)


def draw(engine: SumsEngine, trials: int, generator: np.random.Generator) -> Draws:
    """Draw the numbers of so many trials."""
    constant = [source for source in engine.sources if not source.noise]
    return Draws(
        {s.name: s.standard_deviation * generator.standard_normal((trials, 3)) for s in constant},
        generator.standard_normal((trials, engine.gyro.roots.shape[-1])),
        *([generator.standard_normal((trials, 6)) for _ in engine.cell.names] for _ in range(2)),
    )


def estimates(engine: SumsEngine, draws: Draws) -> np.ndarray:
    """Return the estimates of trials, (trials, cases, 6) [kg·m²], by the first estimator."""
    fluctuation = draws.gyro @ engine.gyro.roots[0, 0].T
    noisy = (
        engine.sums.gram[0, 0] + fluctuation[:, :169].reshape(-1, 13, 13),
        engine.sums.wrench[0, 0] + fluctuation[:, 169:].reshape(-1, 13, 6),
    )
    true = engine.sums.gram[0], engine.sums.wrench[0]
    solutions = []
    for k, case in enumerate(engine.cases):
        error = {s.target: draws.constants[s.name] for s in engine.sources if s.name in case.sources and not s.noise}
        still = np.zeros((1, 3))
        gram, wrench = mapped(*(noisy if engine.gyro.acts[0, k] else true), error.get("omega", still))
        of_pairs, of_features = engine.expectation.gram[k, 0], engine.expectation.feature[k, 0]
        totals = gram[:, :, 0].copy()
        gram[:, 4:, 4:] += (totals @ of_pairs.T)[:, PAIR]
        gram[:, 4:, 0] += of_features * totals[:, :1]
        wrench[:, 4:] += of_features[:, None] * wrench[:, :1]
        cell_bias = np.concatenate(np.broadcast_arrays(error.get("F", still), error.get("M", still)), axis=1)
        white = np.moveaxis(engine.cell.white[k], -1, 0)
        weights = (np.moveaxis(x, -1, 0) for x in (engine.crossed.alone[k, 0], engine.crossed.with_gyro[k, 0, 0]))
        mixed = (
            z @ alone.T + z_with_gyro @ with_gyro.T
            for alone, with_gyro, z, z_with_gyro in zip(*weights, draws.cell, draws.crossed, strict=True)
        )
        noise = [(size, z) for size, z in zip(white, mixed, strict=True) if size.any()]
        solutions.append(solved(gram, wrench, cell_bias, engine.body.r_cg_from_q + error.get("r_cg", still), noise))
    return np.stack(solutions, axis=1)


def campaign(engine: SumsEngine, trials: int, seed: int = 0) -> np.ndarray:
    """Draw and solve so many trials."""
    generator = np.random.Generator(np.random.SFC64(seed))
    sizes = [min(BATCH, trials - first) for first in range(0, trials, BATCH)]
    return np.concatenate([estimates(engine, draw(engine, size, generator)) for size in sizes])
