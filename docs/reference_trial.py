"""The reference trial: the Monte Carlo of the paper in plain JAX, to be read and to be held against.

No blocks, no sums: each trial draws every sample, differentiates, stacks Omega_R and solves least squares, once for
each group of error sources. Run it: ``python docs/reference_trial.py``. Every engine of ``uq`` gives the same, far
faster (``tests/uq/monte_carlo/trials/test_reference_trial.py``).
"""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp

from uq import Experiment, simulate


def omega_r(omega, alpha):
    """Return Omega_R of (7), (3, 6): ``M - r x F = Omega_R i`` with i = (I11, I12, I13, I22, I23, I33)."""
    (w1, w2, w3), (a1, a2, a3) = omega, alpha
    return jnp.array([
        [a1, a2 - w1 * w3, a3 + w1 * w2, -w2 * w3, w2**2 - w3**2, w2 * w3],
        [w1 * w3, a1 + w2 * w3, w3**2 - w1**2, a2, a3 - w1 * w2, -w1 * w3],
        [-w1 * w2, w1**2 - w2**2, a1 - w2 * w3, w1 * w2, a2 + w1 * w3, a3],
    ])  # fmt: skip


def draw(key, truth, sources):
    """Return each source's error: noise is fresh at each sample, (n, 3); a bias is drawn once, (1, 3)."""
    errors = {}
    for source, own in zip(sources, jax.random.split(key, len(sources)), strict=True):
        shape = truth[source.target].shape if source.kind == "precision" else (1, 3)
        errors[source.name] = jnp.asarray(source.sigma)[None] * jax.random.normal(own, shape)
    return errors


def estimate(truth, rate, sources, errors, acting):
    """Return the tensor (6,) that is identified if only the sources named in ``acting`` err."""
    measured = dict(truth)
    for source in sources:
        if source.name in acting:
            measured[source.target] = measured[source.target] + errors[source.name]
    omega = measured["omega"]
    alpha = (omega[2:] - omega[:-2]) * (rate / 2)  # central differences
    moment = measured["M"] - jnp.cross(measured["r_cg"], measured["F"])
    rows = jax.vmap(omega_r)(omega[1:-1], alpha)  # (n - 2, 3, 6)
    return jnp.linalg.lstsq(rows.reshape(-1, 6), moment[1:-1].reshape(-1))[0]


def trial(key, truth, rate, sources, groups):
    """Return one estimate a group, (groups, 6), all from the same draws."""
    errors = draw(key, truth, sources)
    return jnp.stack([estimate(truth, rate, sources, errors, acting) for acting in groups])


def campaign(truth, rate, sources, groups, *, trials, seed=0):
    """Return the estimates of many trials, (trials, groups, 6) [kg m^2]."""
    keys = jax.random.split(jax.random.key(seed), trials)
    return jax.jit(jax.vmap(lambda key: trial(key, truth, rate, sources, groups)))(keys)


def true_signals(experiment, trajectory):
    """Return what perfect sensors would say, (n, 3) each, and the centre of gravity from Q, (1, 3); in SI."""
    run = simulate(replace(experiment, sources=()), trajectory).run
    signals = {"omega": run.omega, "F": run.force, "M": run.moment, "r_cg": experiment.r_cg_from_q[None]}
    return {name: jnp.asarray(signal) for name, signal in signals.items()}


def main():
    """Print the mean error and 3 sigma of each group on ten seconds of T1, in g m^2."""
    jax.config.update("jax_enable_x64", True)
    experiment = Experiment.load(Path(__file__).parents[1] / "uq" / "examples" / "t1-10s.toml")
    sources = experiment.sources
    names = ["total", *dict.fromkeys(source.group for source in sources)]
    groups = [{s.name for s in sources if name in ("total", s.group)} for name in names]
    tensors = campaign(true_signals(experiment, "T1"), 400.0, sources, groups, trials=200)
    for name, of_group in zip(names, jnp.moveaxis(tensors, 1, 0), strict=True):
        mean, sigma = of_group.mean(0) - experiment.body.inertia, of_group.std(0, ddof=1)
        print(f"{name:10}", *(f"{1e3 * m:z8.2f} ± {3e3 * s:6.2f}" for m, s in zip(mean, sigma, strict=True)))


if __name__ == "__main__":
    main()
