"""``python -m benchmarks.collapsed``: the paper's campaign on drawn sums against the same by samples, in alternation.

Both times are of the whole call: all trials, set-up of every trajectory and statistics included, compilation not. By
samples with float32 draws, the fastest.
"""

import argparse
import os
import statistics
import time

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))

from uq.campaign import montecarlo  # noqa: E402
from uq.experiment import Experiment  # noqa: E402


def main() -> None:
    """Time both and print medians, spread and ratio."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.collapsed", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternations (5)")
    parser.add_argument("--trials", type=int, default=10_000, help="trials of the campaign (10000)")
    options = parser.parse_args()
    experiment = Experiment.load("barreto2016")

    def seconds(**settings: str) -> float:
        begin = time.perf_counter()
        montecarlo(experiment, trials=options.trials, estimators="central", **settings)
        return time.perf_counter() - begin

    def both() -> tuple[float, float]:
        return seconds(sampling="collapsed"), seconds(dtype="float32")

    both()  # compile
    rounds = [both() for _ in range(options.rounds)]
    for name, figures in zip(("collapsed", "by samples, float32 draws"), zip(*rounds, strict=True), strict=True):
        print(f"{name:<26} {statistics.median(figures):8.3f} s (median; {min(figures):.3f} … {max(figures):.3f})")
    ratios = [slow / fast for fast, slow in rounds]
    print(f"{'ratio':<26} {statistics.median(ratios):8.1f}   (median; {min(ratios):.1f} … {max(ratios):.1f})")


if __name__ == "__main__":
    main()
