"""CPU time of a trial by the sources it has. ``python -m benchmarks.sources``.

The preset's T1, 72,000 samples, both estimators, one device; beside the preset's own seven sources one more at a time.
User CPU seconds of the process, in five rounds over all; a ratio is of the same round.
"""

import resource

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

from identify.text_tables import text_table  # noqa: E402
from uq.campaign.trial_setup import prepare_setup  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.trials.engines import AnySetup, run_trials  # noqa: E402

MORE = {
    "the preset's": [],
    "and cross-talk, misalignment, tilt": [
        {"target": "wrench", "kind": "cross_talk", "sigma": "1 %", "full_scale": ["300 N"] * 3 + ["20 N*m"] * 3},
        {"target": "wrench", "kind": "misalignment", "sigma": ["1 deg"] * 3},
        {"target": "tilt", "kind": "bias", "sigma": ["1 deg"] * 3},
    ],
    "and the gyro's scale": [{"target": "omega", "kind": "scale", "sigma": ["1 %"] * 3}],
    "and another white noise of the gyro": [{"target": "omega", "kind": "precision", "sigma": ["1e-4 rad/s"] * 3}],
    "and quantisation of F": [{"target": "F", "kind": "quantisation", "step": ["0.1 N"] * 3}],
    "and quantisation of M": [{"target": "M", "kind": "quantisation", "step": ["0.01 N*m"] * 3}],
    "and quantisation of omega": [{"target": "omega", "kind": "quantisation", "step": ["1e-4 rad/s"] * 3}],
    "and flicker of F": [{"target": "F", "kind": "coloured", "flicker": ["0.5 N"] * 3}],
    "and flicker of M": [{"target": "M", "kind": "coloured", "flicker": ["0.05 N*m"] * 3}],
    "and flicker of omega": [{"target": "omega", "kind": "coloured", "flicker": ["5 deg/hour"] * 3}],
    "and delay": [{"target": "omega", "kind": "delay", "sigma": "1 ms"}],
    "and saturation of F": [{"target": "F", "kind": "saturation", "limit": ["200 N"] * 3}],
}
TRIALS, ROUNDS = 16, 5


def prepared(more: list[dict]) -> AnySetup:
    """Return what a trial needs, its code compiled."""
    document = dict(Experiment.load("barreto2016").document)
    named = [{"name": f"more {k}", "group": "more", **source} for k, source in enumerate(more)]
    experiment = Experiment.from_dict(document | {"source": [*document["source"], *named]})
    setup = prepare_setup(experiment, experiment.trajectories["T1"], experiment.estimators)
    seconds(setup)
    return setup


def seconds(setup: AnySetup) -> float:
    """Return user CPU seconds a trial."""
    start = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    run_trials(setup, TRIALS, 0, jax.devices()[:1], batch=8)
    return (resource.getrusage(resource.RUSAGE_SELF).ru_utime - start) / TRIALS


def main() -> None:
    """Print the table."""
    setups = {name: prepared(more) for name, more in MORE.items()}
    times = np.array([[seconds(setup) for setup in setups.values()] for _ in range(ROUNDS)])
    ratios = np.median(times / times[:, :1], axis=0)
    rows = [
        [name, str(len(setup.cases)), f"{1e3 * median:.1f}", f"{ratio:.1f}"]
        for (name, setup), median, ratio in zip(setups.items(), np.median(times, axis=0), ratios, strict=True)
    ]
    print(text_table(["sources", "cases", "CPU ms a trial", "of the preset's"], rows))


if __name__ == "__main__":
    main()
