"""``python -m benchmarks.studies.sampled_paper``: the paper's Table 2 by samples beside the same on sums, as Markdown.

Ten thousand trials by samples (float32 draws) take a quarter of an hour; with ``--checkpoint`` the same call goes on
where it was interrupted. ``--experiment`` takes any other, ``--seconds`` another duration.
"""

import argparse
import os
from collections.abc import Iterator

import jax
import numpy as np

from benchmarks.scaling import lasting
from identify.display.rounding import with_uncertainty
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, MOMENTS, PRODUCTS
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult, average

BY_SAMPLES = SamplingPlan(engine="samples", dtype="float32")
ROUNDING = 1e-7
"""Of float32, in parts of the largest moment: a figure that is known better than this is not compared."""


def figures(result: MonteCarloResult, trajectory: str, estimator: str) -> dict[str, tuple[float, float]]:
    """Return the table's figures of all sources together and their standard errors [g·m²]."""
    moments, products = (average(result, trajectory, estimator, group) for group in (MOMENTS, PRODUCTS))
    total, last = result[trajectory, estimator].total, COMPONENTS.index("I33")
    values = {
        "3σ of moments": (moments.three_sigma, moments.three_sigma_standard_error),
        "3σ of products": (products.three_sigma, products.three_sigma_standard_error),
        "mean error of I33": (total.mean_error[last], total.mean_error_standard_error[last]),
    }
    return {name: (GRAM_METRE * value, GRAM_METRE * error) for name, (value, error) in values.items()}


def differences(sampled: MonteCarloResult, on_sums: MonteCarloResult) -> Iterator[tuple[float, float, str]]:
    """Yield the difference in standard errors and in per cent of 3σ, and what it is of, for every figure."""
    least = ROUNDING * np.abs(on_sums.nominal).max()
    for trajectory, estimators in sampled.breakdowns.items():
        for estimator, breakdown in estimators.items():
            for case, by_samples in breakdown.cases.items():
                sums = on_sums[trajectory, estimator].cases[case]
                for figure in ("three_sigma", "mean_error"):
                    value, other = getattr(by_samples, figure), getattr(sums, figure)
                    name = f"{figure}_standard_error"
                    error = np.hypot(getattr(by_samples, name), getattr(sums, name))
                    for k in np.flatnonzero(error > least):
                        off = value[k] - other[k]
                        words = f"{figure.replace('_', ' ')} of {COMPONENTS[k]}, {trajectory}, {estimator}, {case}"
                        yield off / error[k], 100 * off / sums.three_sigma[k], words


def report(sampled: MonteCarloResult, on_sums: MonteCarloResult) -> str:
    """Return the table, and the largest differences of any case and component."""
    lines = [
        f"| g·m² | figure | {sampled.trials:,} trials by samples | {on_sums.trials:,} on sums | in standard errors |",
        "|---|---|---|---|---|",
    ]
    for trajectory, estimators in sampled.breakdowns.items():
        for estimator in estimators:
            on_other = figures(on_sums, trajectory, estimator)
            for name, (value, error) in figures(sampled, trajectory, estimator).items():
                other, other_error = on_other[name]
                off = (value - other) / np.hypot(error, other_error)
                cells = [with_uncertainty(value, error), with_uncertainty(other, other_error), f"{off:.1f}"]
                lines.append(f"| {trajectory}, {estimator} | {name} | {' | '.join(cells)} |")
    every = list(differences(sampled, on_sums))
    beyond = [words for errors, percent, words in every if abs(errors) > 4 and abs(percent) > 1]
    lines.append(
        f"\nBeyond 4 standard errors and 1 % of 3σ: {len(beyond)} of {len(every)} figures. {'; '.join(beyond)}"
    )
    for place, unit in enumerate(("standard errors", "% of 3σ")):
        largest = max(every, key=lambda row: abs(row[place]))
        lines.append(f"\nLargest of {len(every)} differences: {largest[place]:.2f} {unit}, {largest[2]}.")
    return "\n".join(lines)


def main() -> None:
    """Run both campaigns and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.sampled_paper", description=__doc__)
    parser.add_argument("--trials", type=int, default=10_000, help="trials by samples (10000)")
    parser.add_argument("--sums", type=int, default=100_000, help="trials on sums (100000)")
    parser.add_argument("--experiment", default="barreto2016", help="the preset barreto2016, or a file")
    parser.add_argument("--seconds", type=float, help="duration of the trajectories; the file's unless given")
    parser.add_argument("--checkpoint", metavar="FOLDER", help="keeps trials by samples that are done")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))
    name = options.experiment
    experiment = Experiment.load(name) if options.seconds is None else lasting(options.seconds, name)
    kept = RunOptions(checkpoint=options.checkpoint, progress=True)
    sampled = montecarlo(experiment, trials=options.trials, plan=BY_SAMPLES, options=kept)
    on_sums = montecarlo(experiment, trials=options.sums, seed=1)
    print(report(sampled, on_sums), on_sums.provenance.get("computed", ""), sep="\n\n")


if __name__ == "__main__":
    main()
