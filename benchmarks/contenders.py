"""Ways to run the paper's campaign: each a function of the number of trials, on one core."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial

import jax
import numpy as np

from benchmarks import reference, sums_in_numpy, vectorised
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.monte_carlo.campaign.trial_setup import prepare_engine
from uq.monte_carlo.gram_sums.cases import cases_of
from uq.monte_carlo.trials.chooser import EngineName
from uq.monte_carlo.trials.engine import Engine

TRAJECTORIES = ("T1", "T2", "T3", "T4")
LABELS = {
    "loop": "plain NumPy loop, each group its own trials",
    "numpy float64": "best NumPy version by samples, float64",
    "numpy float32": "the same, float32 draws",
    "samples float64": "engine by samples, float64",
    "samples float32": "the same, float32 draws, float64 sums",
    "numpy sums": "NumPy version on sums",
    "sums": "engine on sums",
}


def contenders(experiment: Experiment) -> dict[str, Callable[[int], object]]:
    """Return, by name, what runs so many trials of every trajectory, each with the four groups."""
    truths = [truth_of(experiment, name) for name in TRAJECTORIES]
    on_sums = engines(experiment, "sums")
    return {
        "loop": partial(_loop, experiment, truths),
        **{f"numpy {dtype}": partial(_vectorised, truths, dtype) for dtype in ("float64", "float32")},
        **{f"samples {d}": partial(trials_of, engines(experiment, "samples", d)) for d in ("float64", "float32")},
        "numpy sums": partial(_sums_in_numpy, list(map(sums_in_numpy.on_host, on_sums))),
        "sums": partial(trials_of, on_sums),
    }


def truth_of(experiment: Experiment, name: str) -> vectorised.Truth:
    """Return a trajectory without noise."""
    run = simulate(dataclasses.replace(experiment, sources=()), name).run
    sigma = {f"{s.target}_{s.kind}": np.asarray(s.sigma) for s in experiment.sources}
    wrench = np.ascontiguousarray(np.concatenate([run.force.T, run.moment.T]))
    rate = experiment.trajectories[name].rate
    return vectorised.Truth(np.ascontiguousarray(run.omega.T), wrench, rate, experiment.r_cg_from_q, sigma)


def engines(
    experiment: Experiment, engine: EngineName, dtype: str = "float64", trajectories: Sequence[str] = TRAJECTORIES
) -> list[Engine]:
    """Return the prepared trajectories: what a campaign does once, whatever its number of trials."""
    groups = [case for case in cases_of(experiment.sources) if not case.name.startswith("source:")]
    prepared = [
        prepare_engine(
            experiment, experiment.trajectories[name], [experiment.estimator("central")], engine=engine, dtype=dtype,
            cases=groups,
        )[0]
        for name in trajectories
    ]  # fmt: skip
    return jax.block_until_ready(prepared)


def trials_of(
    prepared: Sequence[Engine], trials: int, devices: Sequence[jax.Device] | None = None, batch: int | None = None
) -> list:
    """Return the estimates of so many trials of each engine; ``devices``: None for the first."""
    loops = [engine.loop(0, devices=devices or jax.devices()[:1], batch=batch) for engine in prepared]
    for loop in loops:
        loop.reach(trials)
    return [loop.results(trials) for loop in loops]


def _loop(experiment: Experiment, truths: list[vectorised.Truth], trials: int) -> None:
    for truth in truths:
        signals = {"omega": truth.omega.T, "F": truth.wrench[:3].T, "M": truth.wrench[3:].T}
        reference.campaign(signals, experiment.sources, truth.rate, experiment.r_cg_from_q, trials)


def _vectorised(truths: list[vectorised.Truth], dtype: str, trials: int) -> list[np.ndarray]:
    generator = np.random.Generator(np.random.SFC64(0))
    return [vectorised.estimates(truth, trials, generator, dtype) for truth in truths]


def _sums_in_numpy(prepared: list, trials: int) -> list[np.ndarray]:
    return [sums_in_numpy.campaign(engine, trials) for engine in prepared]
