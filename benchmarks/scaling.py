"""Cost and memory of trials on sums against their number, samples and devices. ``python -m benchmarks.scaling``.

The preset's T1, estimator central, all cases. Each row is a process of its own, held to as many cores as devices, one
but for their own table; the second of two calls is measured, since the first compiles.
"""

import argparse
import dataclasses
import json
import os
import resource
import subprocess
import sys
import time
from functools import partial

import jax
import numpy as np

from benchmarks.contenders import trials_of
from identify.display.text_tables import text_table
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.campaign.trial_setup import prepare_engine

TRIALS, SAMPLES = (1_000, 10_000, 100_000, 1_000_000), (4_000, 20_000, 72_000, 400_000, 2_000_000)
RATE = 400
"""Of the preset [Hz]."""
HEADS = {
    "trials": ["processor time, s", "µs a trial", "peak GiB"],
    "samples": ["set-up, s", "µs a trial", "peak GiB"],
    "devices": ["s, 200,000 trials on sums", "s, 50 by samples"],
}


def lasting(seconds: float, name: str = "barreto2016") -> Experiment:
    """Return an experiment, the preset or a file, with trajectories that last so long."""

    def shorter(spec: TrajectorySpec) -> TrajectorySpec:
        motion = dataclasses.replace(spec.trajectory, duration=np.array(seconds), ramp=np.array(0.15 * seconds))
        return dataclasses.replace(spec, duration=seconds, trajectory=motion)

    experiment = Experiment.load(name)
    return dataclasses.replace(experiment, trajectories={n: shorter(s) for n, s in experiment.trajectories.items()})


def trials_row(count: int) -> list[float]:
    """Return processor time of a whole campaign of so many trials, a trial's, and the peak memory."""
    campaign = partial(montecarlo, Experiment.load("barreto2016"), trajectories="T1", estimators="central")
    seconds = second_time(lambda: campaign(trials=count), time.process_time)
    return [seconds, 1e6 * seconds / count, peak_memory()]


def samples_row(count: int) -> list[float]:
    """Return processor time of set-up and of a trial, and the peak memory."""
    experiment = lasting(count / RATE)
    spec, estimators = experiment.trajectories["T1"], [experiment.estimator("central")]
    prepare = lambda: jax.block_until_ready(prepare_engine(experiment, spec, estimators)[0])  # noqa: E731
    once, engine = second_time(prepare, time.process_time), prepare()
    seconds = second_time(lambda: trials_of([engine], 20_000), time.process_time)
    return [once, 1e6 * seconds / 20_000, peak_memory()]


def devices_row(count: int) -> list[float]:
    """Return seconds of a campaign on so many devices, on sums and by samples."""
    campaign = partial(montecarlo, Experiment.load("barreto2016"), trajectories="T1", estimators="central")
    options = RunOptions(devices=jax.devices()[:count])
    plans = (200_000, SamplingPlan()), (50, SamplingPlan(engine="samples", dtype="float32"))
    return [second_time(lambda n=n, plan=plan: campaign(trials=n, plan=plan, options=options)) for n, plan in plans]


ROWS = {"trials": trials_row, "samples": samples_row, "devices": devices_row}


def second_time(run, clock=time.perf_counter) -> float:
    """Return the seconds of a call's second run."""
    run()
    start = clock()
    run()
    return clock() - start


def peak_memory() -> float:
    """Return the peak memory of this process [GiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def measured(kind: str, count: int) -> list[float]:
    """Return a row from a process of its own."""
    command = [sys.executable, "-m", "benchmarks.scaling", "--row", kind, str(count)]
    cores = sorted(os.sched_getaffinity(0))[-(count if kind == "devices" else 1) :]
    hold = lambda: os.sched_setaffinity(0, cores)  # noqa: E731 - before NumPy's and JAX's threads are counted
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, preexec_fn=hold).stdout)


def print_row(kind: str, count: int) -> None:
    """Measure a row in this process."""
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_num_cpu_devices", count if kind == "devices" else 1)
    print(json.dumps(ROWS[kind](count)))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--only", choices=list(ROWS), help="one of the tables")
    parser.add_argument("--row", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        print_row(options.row[0], int(options.row[1]))
        return
    counts = {"trials": TRIALS, "samples": SAMPLES, "devices": range(1, len(os.sched_getaffinity(0)) + 1)}
    for kind in [options.only] if options.only else list(ROWS):
        rows = [[f"{n:,}", *(f"{value:.3g}" for value in measured(kind, n))] for n in counts[kind]]
        print(text_table([kind, *HEADS[kind]], rows))


if __name__ == "__main__":
    main()
