"""``python -m benchmarks.collapsed``: the paper's campaign on drawn sums against the same by samples, in alternation.

Both times are of the whole call: all trials, set-up of every trajectory and statistics included, compilation not. By
samples with float32 draws, the fastest. Processor time beside elapsed time tells whether the machine was free: of two
cores in full use it is twice as long.
"""

import argparse
import os
import statistics
import time
from collections.abc import Sequence

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))

from uq.campaign.campaign import montecarlo  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402


def main() -> None:
    """Time both and print medians, spread and ratio."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.collapsed", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternations (5)")
    parser.add_argument("--trials", type=int, default=10_000, help="trials of the campaign (10000)")
    options = parser.parse_args()
    experiment = Experiment.load("barreto2016")

    def seconds(**settings: str) -> tuple[float, float]:
        begin = time.perf_counter(), time.process_time()
        montecarlo(experiment, trials=options.trials, estimators="central", **settings)
        return time.perf_counter() - begin[0], time.process_time() - begin[1]

    def both() -> tuple[tuple[float, float], tuple[float, float]]:
        return seconds(sampling="collapsed"), seconds(dtype="float32")

    both()  # compile
    rounds = [both() for _ in range(options.rounds)]
    for name, pairs in zip(("collapsed", "by samples, float32 draws"), zip(*rounds, strict=True), strict=True):
        for kind, figures in zip(("", ", processor time"), zip(*pairs, strict=True), strict=True):
            _print(name + kind, figures, "s")
    for k, kind in enumerate(("", ", processor time")):
        _print("ratio" + kind, [slow[k] / fast[k] for fast, slow in rounds], " ")


def _print(name: str, figures: Sequence[float], unit: str) -> None:
    print(f"{name:<42} {statistics.median(figures):8.3f} {unit} (median; {min(figures):.3f} … {max(figures):.3f})")


if __name__ == "__main__":
    main()
