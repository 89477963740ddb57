"""Processor time of a trial of T1 on one core, for a busy machine: ``python -m benchmarks.processor_time [DTYPE]``."""

import os
import sys
import time
from collections.abc import Callable

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax

jax.config.update("jax_enable_x64", True)

from benchmarks.contenders import LABELS, TRAJECTORIES, contenders, truths_of  # noqa: E402
from benchmarks.vectorised import estimates  # noqa: E402
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES  # noqa: E402
from identify.text_tables import text_table  # noqa: E402
from uq.campaign.trial_setup import prepare_setup  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.trials.engines import run_trials  # noqa: E402


def milliseconds(run: Callable[[], object], trials: int) -> float:
    """Return the least processor time of five runs after one that compiles."""
    taken = []
    for _ in range(6):
        start = time.process_time()
        run()
        taken.append(time.process_time() - start)
    return 1e3 * min(taken[1:]) / trials


def measure(dtype: str, trials: int = 64) -> list[list[str]]:
    """Return the table's rows."""
    experiment = Experiment.load("barreto2016")
    setup = prepare_setup(experiment, experiment.trajectories["T1"], [experiment.estimator("central")], dtype=dtype)
    truth = truths_of(experiment)[0]
    floors = contenders(experiment, [f"floor {dtype}", f"jax floor {dtype}"])
    share = trials // len(TRAJECTORIES)
    ways: dict[str, Callable[[], object]] = {
        f"engine {dtype}": lambda: run_trials(setup, trials, 0, jax.devices()[:1], 8),
        f"numpy {dtype}": lambda: estimates(truth, trials, 0, dtype, OMEGA_R_OF_FEATURES),
        **{name: lambda way=way: way(share) for name, way in floors.items()},
    }
    return [[LABELS[name], f"{milliseconds(way, trials):.2f}"] for name, way in ways.items()]


if __name__ == "__main__":
    print(text_table(["", "ms of processor time"], measure(sys.argv[1] if len(sys.argv) > 1 else "float32")))
