"""CPU time of a trial by the sources it has. ``python -m benchmarks.sources``.

The preset's T1, 72,000 samples, both estimators, one device; beside the preset's own seven sources one more at a time.
"""

import time

import jax

jax.config.update("jax_enable_x64", True)

from identify.text_tables import text_table  # noqa: E402
from uq.campaign.trial_setup import prepare_setup  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.trials.engines import run_trials  # noqa: E402

MORE = {
    "the preset's": [],
    "and cross-talk, misalignment, tilt": [
        {"target": "wrench", "kind": "cross_talk", "sigma": "1 %", "full_scale": ["300 N"] * 3 + ["20 N*m"] * 3},
        {"target": "wrench", "kind": "misalignment", "sigma": ["1 deg"] * 3},
        {"target": "tilt", "kind": "bias", "sigma": ["1 deg"] * 3},
    ],
    "and the gyro's scale": [{"target": "omega", "kind": "scale", "sigma": ["1 %"] * 3}],
    "and quantisation of F": [{"target": "F", "kind": "quantisation", "step": ["0.1 N"] * 3}],
    "and the gyro's flicker": [{"target": "omega", "kind": "coloured", "flicker": ["5 deg/hour"] * 3}],
    "and delay": [{"target": "omega", "kind": "delay", "sigma": "1 ms"}],
}


def measure(more: list[dict], trials: int = 20) -> tuple[str, int, float]:
    """Return how it is computed, the number of cases, CPU seconds a trial."""
    document = dict(Experiment.load("barreto2016").document)
    named = [{"name": f"more {k}", "group": "more", **source} for k, source in enumerate(more)]
    experiment = Experiment.from_dict(document | {"source": [*document["source"], *named]})
    setup = prepare_setup(experiment, experiment.trajectories["T1"], experiment.estimators)
    run_trials(setup, trials, 1, jax.devices()[:1])
    start = time.process_time()
    run_trials(setup, trials, 0, jax.devices()[:1])
    how = {"Setup": "sums", "SampledSetup": "samples"}[type(setup).__name__]
    return how, len(setup.cases), (time.process_time() - start) / trials


def main() -> None:
    """Print the table."""
    rows = []
    for name, more in MORE.items():
        how, cases, seconds = measure(more)
        rows.append([name, how, str(cases), f"{seconds:.3f}"])
    print(text_table(["sources", "computed from", "cases", "CPU seconds a trial"], rows))


if __name__ == "__main__":
    main()
