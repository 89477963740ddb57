"""What batches of the public least squares cost: ``vmap`` against ``lax.map`` against a loop, a trial.

    python -m benchmarks.batches [--samples 15000] [--trials 64] [--rounds 5]

The angular velocity differs from trial to trial. Rounds are interleaved; the least time of each counts.
"""

import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np

from identify import EstimatorSpec, ordinary_least_squares
from identify.display.text_tables import text_table

ESTIMATORS = (EstimatorSpec("central", "central"), EstimatorSpec("matched", "savitzky-golay", band=1.0))
RATE = 400.0


def ways(samples: int, trials: int, estimator: EstimatorSpec, dtype: str):
    """Return the functions that compute the tensors of so many trials, by name, and the trials' angular velocities."""
    generator, t = np.random.default_rng(0), np.arange(samples) / RATE
    motion = np.stack([np.sin(2 * t), np.cos(1.7 * t), np.sin(1.3 * t + 1)], axis=1)
    force, moment = (jnp.asarray(x, dtype) for x in generator.normal(size=(2, samples, 3)))
    omega = jnp.asarray(motion + 0.01 * generator.normal(size=(trials, samples, 3)), dtype)
    r_cg = jnp.asarray([0.0, 0.0, 0.05], dtype)

    def trial(omega):
        return ordinary_least_squares(force, moment, omega, rate=RATE, r_cg=r_cg, estimator=estimator)

    single = jax.jit(trial)
    return omega, {
        "vmap": jax.jit(jax.vmap(trial)),
        "lax.map": jax.jit(lambda omega: jax.lax.map(trial, omega)),
        "a loop of jit": lambda omega: jnp.stack([single(each) for each in omega]),
    }


def main() -> None:
    """Print milliseconds a trial, and their ratio to ``lax.map``."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--samples", type=int, default=15_000)
    parser.add_argument("--trials", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = []
    for dtype in ("float64", "float32"):
        for estimator in ESTIMATORS:
            omega, functions = ways(options.samples, options.trials, estimator, dtype)
            least = dict.fromkeys(functions, np.inf)
            for turn in range(options.rounds + 1):
                for name, function in functions.items():
                    began = time.perf_counter()
                    function(omega).block_until_ready()
                    if turn:  # the first compiles
                        least[name] = min(least[name], time.perf_counter() - began)
            figures = [f"{1e3 * least[name] / options.trials:.2f}" for name in functions]
            rows.append([f"{estimator.name}, {dtype}", *figures, f"{least['vmap'] / least['lax.map']:.2f}"])
    print(text_table(["ms a trial", *functions, "vmap / lax.map"], rows))


if __name__ == "__main__":
    main()
