"""``make bench``: the paper's campaign, engine against reference, in alternation; JSON to standard output or a file."""

import argparse
import dataclasses
import json
import os
import resource
import statistics
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))

import numpy as np  # noqa: E402

from benchmarks.reference import GROUPS, campaign  # noqa: E402
from identify.tables import text_table  # noqa: E402
from uq.campaign import montecarlo  # noqa: E402
from uq.experiment import Experiment  # noqa: E402
from uq.simulation import simulate  # noqa: E402

TRAJECTORIES = ("T1", "T2", "T3", "T4")
LABELS = {"reference": "plain NumPy loop", "float64": "engine, float64", "float32": "engine, float32 draws"}


def main() -> int:
    """Time both, print the table, write the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="alternations of engine and reference (3)")
    parser.add_argument("--trials", type=int, default=400, help="engine's trials per trajectory and round (400)")
    parser.add_argument("--reference-trials", type=int, default=6, help="reference's trials per group and round (6)")
    parser.add_argument("--campaign", type=int, default=10_000, help="trials of the campaign that times are scaled to")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    options = parser.parse_args()
    figures = measure(options)
    print(report(figures))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(figures, file, indent=1)
    return 0


def measure(options: argparse.Namespace) -> dict:
    """Return seconds of the whole campaign, round by round, and the ratio of the medians."""
    experiment = Experiment.load("barreto2016")
    silent = dataclasses.replace(experiment, sources=())
    runs = {name: simulate(silent, name).run for name in TRAJECTORIES}
    truths = {name: {"omega": run.omega, "F": run.force, "M": run.moment} for name, run in runs.items()}
    rate = experiment.trajectories["T1"].rate

    def engine(dtype):
        start = time.perf_counter()
        montecarlo(experiment, trials=options.trials, estimators=["central"], dtype=dtype)
        return (time.perf_counter() - start) * options.campaign / options.trials

    def reference():
        start = time.perf_counter()
        for name in TRAJECTORIES:
            campaign(truths[name], experiment.sources, rate, experiment.r_cg_from_q, options.reference_trials)
        return (time.perf_counter() - start) * options.campaign / options.reference_trials

    engine("float64"), engine("float32"), reference()  # compile, warm up
    seconds: dict[str, list[float]] = {"float64": [], "float32": [], "reference": []}
    for _ in range(options.rounds):
        for name in ("float64", "float32"):
            seconds[name].append(engine(name))
        seconds["reference"].append(reference())
    median = {name: statistics.median(values) for name, values in seconds.items()}
    return {
        "campaign": f"{len(TRAJECTORIES)} trajectories x {len(GROUPS)} groups x {options.campaign} trials",
        "cores": len(os.sched_getaffinity(0)),
        "seconds": seconds,
        "median_seconds": median,
        "times_faster": {name: median["reference"] / median[name] for name in ("float64", "float32")},
        "peak_memory_GiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "numpy": np.__version__,
        "jax": jax.__version__,
    }


def report(figures: dict) -> str:
    """Return the figures as a table."""
    head = ["", "campaign, s (median)", "min", "max", "times the reference's speed"]
    rows = []
    for name, label in (
        ("reference", "plain NumPy loop"),
        ("float64", "engine, float64"),
        ("float32", "engine, float32 draws"),
    ):
        values = figures["seconds"][name]
        faster = figures["times_faster"].get(name)
        rows.append([label, f"{figures['median_seconds'][name]:.1f}", f"{min(values):.1f}", f"{max(values):.1f}",
                     f"{faster:.1f}" if faster else "1"])  # fmt: skip
    lines = [figures["campaign"] + f", estimator central, {figures['cores']} cores", text_table(head, rows)]
    return "\n".join(
        [*lines, f"peak memory {figures['peak_memory_GiB']:.2f} GiB (engine and reference in one process)"]
    )


if __name__ == "__main__":
    sys.exit(main())
