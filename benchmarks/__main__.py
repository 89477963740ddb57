"""``make bench``: a trial of the paper's campaign on one core, engines against NumPy in alternation, processor time."""

import argparse
import os
import statistics
import time

os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})  # before NumPy's and JAX's threads are counted

import jax  # noqa: E402

jax.config.update("jax_enable_x64", True)

from benchmarks.contenders import LABELS, TRAJECTORIES, contenders, engines  # noqa: E402
from identify.display.text_tables import text_table  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402

TRIALS = {"loop": 2, "sums": 20_000, "numpy sums": 10_000}
"""Trials per trajectory and round, where a trial is no matter of milliseconds."""
RATIOS = (
    ("loop", "samples float32"), ("samples float64", "numpy float64"), ("samples float32", "numpy float32"),
    ("numpy sums", "sums"), ("samples float32", "sums"),
)  # fmt: skip
"""What is compared: the time of the first over that of the second."""


def main() -> None:
    """Time all and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternations (5)")
    parser.add_argument("--trials", type=int, default=24, help="trials by samples per trajectory and round (24)")
    options = parser.parse_args()
    experiment = Experiment.load("barreto2016")
    ways = contenders(experiment)
    trials = {name: TRIALS.get(name, options.trials) for name in ways}
    taken: dict[str, list[float]] = {name: [] for name in ways}
    once: dict[str, list[float]] = {"sums": [], "samples": []}
    for _ in range(options.rounds + 1):
        for name, way in ways.items():
            taken[name].append(seconds(lambda way=way, name=name: way(trials[name])) / trials[name] / len(TRAJECTORIES))
        for name, values in once.items():
            values.append(seconds(lambda name=name: engines(experiment, name)))
    taken = {name: values[1:] for name, values in taken.items()}  # the first round compiles
    rows = [[LABELS[name], *(f"{1e3 * f(x):.3g}" for f in (statistics.median, min, max))] for name, x in taken.items()]
    print(text_table(["ms of processor time a trial (four groups)", "median", "least", "most"], rows))
    rounds = [(a, b, [x / y for x, y in zip(taken[a], taken[b], strict=True)]) for a, b in RATIOS]
    rows = [[f"{a} over {b}", *(f"{f(x):.3g}" for f in (statistics.median, min, max))] for a, b, x in rounds]
    print(text_table(["ratio of times, round by round", "median", "least", "most"], rows))
    for name, values in once.items():
        print(f"set-up of the four trajectories for {name}: {statistics.median(values[1:]):.2f} s")


def seconds(run) -> float:
    """Return the processor time of a call."""
    start = time.process_time()
    run()
    return time.process_time() - start


if __name__ == "__main__":
    main()
