"""``make bench``: the paper's campaign, engine against references and floors in alternation; a table, JSON if asked."""

import argparse
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

from benchmarks.contenders import CORES, LABELS, TRAJECTORIES, contenders, in_segments, setups  # noqa: E402
from benchmarks.reference import GROUPS  # noqa: E402
from identify.text_tables import text_table  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402


def main() -> int:
    """Time all, print the table, write the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternations (5)")
    parser.add_argument(
        "--trials", type=int, default=400, help="trials per trajectory and round (400), the engine's in whole segments"
    )
    parser.add_argument("--loop-trials", type=int, default=4, help="the loop's trials per group and round (4)")
    parser.add_argument("--campaign", type=int, default=10_000, help="trials of the campaign that times are scaled to")
    parser.add_argument("--only", nargs="*", metavar="NAME", choices=list(LABELS), help=f"some of {', '.join(LABELS)}")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    options = parser.parse_args()
    figures = measure(options)
    print(report(figures))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(figures, file, indent=1)
    return 0


def measure(options: argparse.Namespace) -> dict:
    """Return seconds of the whole campaign by contender, round by round, and the ratios of the medians.

    Trials are fewer and their time is scaled; what the engine does once a campaign is timed apart and added.
    """
    experiment = Experiment.load("barreto2016")
    ways = contenders(experiment, options.only or ())
    trials = {name: options.loop_trials if name in ("loop", "openturns") else options.trials for name in ways}
    for name, way in ways.items():  # compile, warm up
        way(trials[name])
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    prepared: list[float] = []
    for _ in range(options.rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            way(trials[name])
            ran, asked = (in_segments(n) if name.startswith("engine") else n for n in (trials[name], options.campaign))
            taken = (time.perf_counter() - start) * asked / ran
            once = 0.0
            if name.startswith("engine"):
                start = time.perf_counter()
                setups(experiment, name.removeprefix("engine "))
                once = time.perf_counter() - start
                prepared.append(once)
            seconds[name].append(taken + once)
    median = {name: statistics.median(values) for name, values in seconds.items()}
    return {
        "campaign": f"{len(TRAJECTORIES)} trajectories x {len(GROUPS)} groups x {options.campaign} trials",
        "cores": CORES,
        "seconds": seconds,
        "median_seconds": median,
        "ratios": ratios(median),
        "set_up_seconds": statistics.median(prepared) if prepared else None,
        "peak_memory_GiB": {
            "this process": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
            "largest worker": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20,
        },
        "numpy": np.__version__,
        "jax": jax.__version__,
    }


def ratios(median: dict[str, float]) -> dict[str, dict[str, float]]:
    """Return the engine's speed as multiples of the others', and its time as a multiple of the floors'."""
    found = {}
    for dtype in ("float64", "float32"):
        engine = median.get(f"engine {dtype}")
        if engine is None:
            continue
        faster = {name: median[name] / engine for name in ("loop", f"numpy {dtype}", "openturns") if name in median}
        slower = {name: engine / median[name] for name in (f"floor {dtype}", f"jax floor {dtype}") if name in median}
        found[dtype] = {f"speed over {k}": v for k, v in faster.items()} | {
            f"time over {k}": v for k, v in slower.items()
        }
    return found


def report(figures: dict) -> str:
    """Return the figures as tables."""
    rows = []
    for name, values in figures["seconds"].items():
        middle = figures["median_seconds"][name]
        rows.append([LABELS[name], f"{middle:.1f}", f"{min(values):.1f}", f"{max(values):.1f}"])
    lines = [f"{figures['campaign']}, estimator central, {figures['cores']} cores"]
    lines.append(text_table(["", "campaign, s (median)", "min", "max"], rows))
    for dtype, found in figures["ratios"].items():
        lines.append(f"engine {dtype}: " + ", ".join(f"{name} {value:.2f}" for name, value in found.items()))
    if figures["set_up_seconds"] is not None:
        lines.append(f"the engine's set-up of the four trajectories, in its figures: {figures['set_up_seconds']:.2f} s")
    memory = figures["peak_memory_GiB"]
    return "\n".join([*lines, "peak memory, GiB: " + ", ".join(f"{k} {v:.2f}" for k, v in memory.items())])


if __name__ == "__main__":
    sys.exit(main())
