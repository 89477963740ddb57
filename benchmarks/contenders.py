"""Ways to run the paper's campaign, and the floors under them: each a function of the number of trials."""

import dataclasses
import os
from collections.abc import Callable, Collection
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, PartitionSpec

from benchmarks import reference, vectorised
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from uq.campaign.simulation import simulate
from uq.campaign.trial_setup import prepare_setup
from uq.experiment.experiment import Experiment
from uq.sources.draws import BLOCK
from uq.sources.random_normals import normal_pairs
from uq.trials.engines import AnySetup, default_batch, run_trials
from uq.trials.trial_loop import segment_of

TRAJECTORIES = ("T1", "T2", "T3", "T4")
CORES = len(os.sched_getaffinity(0))
DTYPES = ("float64", "float32")
LABELS = {
    "loop": "plain NumPy loop, each group its own trials",
    **{f"numpy {d}": f"best NumPy version, a process per core, {d} draws" for d in DTYPES},
    "openturns": "OpenTURNS draws, NumPy sums",
    "engine float64": "engine, all in float64",
    "engine float32": "engine, float32 draws, float64 sums and solutions",
    **{f"floor {d}": f"the engine's random numbers alone, {d}" for d in DTYPES},
    **{f"jax floor {d}": f"as many numbers of jax.random.normal, {d}" for d in DTYPES},
}


def contenders(experiment: Experiment, wanted: Collection[str] = ()) -> dict[str, Callable[[int], object]]:
    """Return, by name, what runs so many trials of every trajectory (and of every group, where these do not share)."""
    truths = truths_of(experiment)
    blocks = -(-truths[0].omega.shape[1] // BLOCK)
    ways: dict[str, Callable[[int], object] | None] = {}
    for name in wanted or LABELS:
        kind, _, dtype = name.rpartition(" ")
        if name == "loop":
            ways[name] = partial(_loop, experiment, truths)
        elif name == "openturns":
            ways[name] = _openturns(truths)
        elif kind == "numpy":
            ways[name] = partial(vectorised.Workers(truths, OMEGA_R_OF_FEATURES, CORES).campaign, dtype=dtype)
        elif kind == "engine":
            ways[name] = partial(_engine, setups(experiment, dtype))
        else:
            ways[name] = _drawing(partial(_pairs if kind == "floor" else _library, dtype=dtype), blocks)
    return {name: way for name, way in ways.items() if way}


def truths_of(experiment: Experiment) -> list[vectorised.Truth]:
    """Return every trajectory without noise."""
    silent = dataclasses.replace(experiment, sources=())
    sigma = {f"{s.target}_{s.kind}": np.asarray(s.sigma) for s in experiment.sources}
    found = []
    for name in TRAJECTORIES:
        run, rate = simulate(silent, name).run, experiment.trajectories[name].rate
        wrench = np.ascontiguousarray(np.concatenate([run.force.T, run.moment.T]))
        omega = np.ascontiguousarray(run.omega.T)
        found.append(vectorised.Truth(omega, wrench, rate, experiment.r_cg_from_q, sigma))
    return found


def _loop(experiment: Experiment, truths: list[vectorised.Truth], trials: int) -> None:
    for truth in truths:
        signals = {"omega": truth.omega.T, "F": truth.wrench[:3].T, "M": truth.wrench[3:].T}
        reference.campaign(signals, experiment.sources, truth.rate, experiment.r_cg_from_q, trials)


def setups(experiment: Experiment, dtype: str) -> list[AnySetup]:
    """Return the prepared trajectories: what a campaign does once, whatever its number of trials."""
    chosen = [experiment.estimator("central")]
    found = [prepare_setup(experiment, experiment.trajectories[name], chosen, dtype=dtype) for name in TRAJECTORIES]
    return jax.block_until_ready(found)


def _engine(prepared: list[AnySetup], trials: int):
    return [run_trials(one, trials, 0, jax.devices(), default_batch(jax.devices()[0])) for one in prepared]


def in_segments(trials: int) -> int:
    """Return how many trials the engine really runs for so many: whole segments."""
    devices = jax.devices()
    segment = segment_of(devices, default_batch(devices[0]), trials)
    return -(-trials // segment) * segment


def _pairs(key, block, dtype):
    return normal_pairs(key, block, jax.lax.iota(jnp.uint32, 3 * BLOCK // 2), dtype)


def _library(key, block, dtype):
    return jax.random.normal(jax.random.fold_in(key, block), (3, BLOCK), dtype)


def _drawing(draw: Callable, blocks: int) -> Callable[[int], object]:
    """What draws a gyro's noise for so many trials of every trajectory on every device, and keeps a block."""
    mesh = Mesh(np.array(jax.devices()), ("trials",), axis_types=(AxisType.Auto,))
    split = PartitionSpec("trials")

    def of_trial(index):
        key = jax.random.fold_in(jax.random.key(0), index)
        block = jnp.zeros_like(draw(key, 0))  # every block is carried, so that none is left out
        return jax.lax.scan(lambda _, number: (draw(key, number), None), block, jnp.arange(blocks))[0].ravel()[:1]

    def of_device(mine):
        return jax.lax.map(of_trial, mine)

    options = {"xla_cpu_prefer_vector_width": 512}
    run = jax.jit(
        jax.shard_map(of_device, mesh=mesh, in_specs=split, out_specs=split, check_vma=False), compiler_options=options
    )

    def drawing(trials):
        share = -(-trials // len(mesh.devices)) * len(mesh.devices)
        for _ in TRAJECTORIES:
            np.asarray(run(jnp.arange(share)))

    return drawing


def _openturns(truths: list[vectorised.Truth]) -> Callable[[int], object] | None:
    """OpenTURNS drawing the same model's inputs, white noise included, with the sums of the NumPy version as function.

    None where the package is not installed; it is no dependency of this one.
    """
    try:
        import openturns
    except ImportError:
        return None
    noise = openturns.Normal()

    class Generator:
        """Enough of NumPy's generator for :func:`vectorised.estimates`, on OpenTURNS's own draws."""

        def standard_normal(self, shape=None, dtype="float64", out=None):
            shape = out.shape if out is not None else shape
            drawn = np.asarray(noise.getSample(int(np.prod(shape)))).reshape(shape)
            if out is None:
                return drawn.astype(dtype)
            out[...] = drawn
            return out

    def campaign(trials):
        for truth in truths:
            vectorised.estimates(truth, trials, 0, "float64", OMEGA_R_OF_FEATURES, Generator())

    return campaign
