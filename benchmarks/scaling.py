"""Cost and memory against trials, samples, sources and devices. ``python -m benchmarks.scaling [--json FILE]``.

The preset's T1, float32 draws, estimator central. Every figure is the fastest of three runs after one that compiles;
memory is the largest of a process of its own.
"""

import argparse
import dataclasses
import json
import os
import resource
import subprocess
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))

import numpy as np  # noqa: E402

from identify.text_tables import text_table  # noqa: E402
from uq.campaign.trial_setup import prepare_setup  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.trials.engines import run_trials  # noqa: E402

TRIALS, SAMPLES = (16, 192, 1920, 19_200), (720, 7200, 72_000, 720_000)  # trials: whole segments of two devices


def setup_of(samples: int = 72_000, sources: int = 7):
    """Return the preset's T1 of another length, with some of its sources."""
    experiment = Experiment.load("barreto2016")
    spec, keep = experiment.trajectories["T1"], ("omega_precision", "omega_bias", "M_precision")
    order = sorted(experiment.sources, key=lambda s: keep.index(s.name) if s.name in keep else len(keep))
    seconds = samples / spec.rate
    motion = dataclasses.replace(spec.trajectory, duration=np.array(seconds), ramp=np.array(0.15 * seconds))
    spec = dataclasses.replace(spec, duration=seconds, trajectory=motion)
    experiment = dataclasses.replace(experiment, sources=tuple(order[:sources]), trajectories={"T1": spec})
    return prepare_setup(experiment, spec, [experiment.estimator("central")], dtype="float32")


def seconds_of(setup, trials: int, devices=None) -> float:
    """Return the fastest of three runs."""
    taken = []
    for _ in range(4):
        start = time.perf_counter()
        run_trials(setup, trials, 0, devices or jax.devices(), 8)
        taken.append(time.perf_counter() - start)
    return min(taken[1:])


def memory_of(trials: int) -> float:
    """Return the peak memory [GiB] of a process that runs so many trials."""
    code = f"from benchmarks import scaling; scaling.print_memory({trials})"
    return float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True).stdout)


def print_memory(trials: int) -> None:
    """Run so many trials, print this process's peak memory [GiB]."""
    run_trials(setup_of(), trials, 0, jax.devices(), 8)
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    whole = setup_of()
    found = {
        "trials": {n: (t := seconds_of(whole, n), 1e3 * t / n, memory_of(n)) for n in TRIALS},
        "samples": {n: (t := seconds_of(setup_of(n), 192), 1e6 * t / 192 / n) for n in SAMPLES},
        "sources": {n: (t := seconds_of(setup_of(sources=n), 384), 1e3 * t / 384) for n in (1, 2, 3, 7)},
        "devices": {
            n: (t := seconds_of(whole, 384, jax.devices()[:n]), 1e3 * t / 384) for n in range(1, len(jax.devices()) + 1)
        },
    }
    heads = {
        "trials": ["s", "ms a trial", "peak GiB"], "samples": ["s, 192 trials", "µs a trial and sample"],
        "sources": ["s, 384 trials", "ms a trial"], "devices": ["s, 384 trials", "ms a trial"],
    }  # fmt: skip
    for name, rows in found.items():
        print(text_table([name, *heads[name]], [[f"{n}", *(f"{v:.3g}" for v in values)] for n, values in rows.items()]))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(found, file, indent=1)


if __name__ == "__main__":
    main()
