"""The paper's campaign on one graphics processor, float32 draws, beside its floor. ``python -m benchmarks.gpu``.

On a machine without one it says so, and runs on what there is if ``--anyway`` is given.
"""

import argparse
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

from benchmarks.contenders import TRAJECTORIES  # noqa: E402
from identify.text_tables import text_table  # noqa: E402
from uq.campaign.campaign import montecarlo  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402

SAMPLES, TRIALS = 72_000, 10_000
INTEGER = SAMPLES * 3 / 2 * 80
"""Integer operations of a trial: 20 rounds of addition, rotation and exclusive or, and the keys, a pair of draws."""
FLOATING = SAMPLES * (3 / 2 * 45 + 60 + 12 * 19)
"""Multiply-adds of a trial: Box–Muller, features, one product of 12 changes with 19 functions."""
BYTES = SAMPLES * 4 * (3 * 2 + 12 * 3)
"""Memory traffic of a trial in float32: noise written and read, changes written and read, half changes written."""
H200 = {"integer": 132 * 64 * 1.98e9, "floating": 132 * 128 * 1.98e9, "bytes": 4.8e12}
"""Operations a second and bytes a second of one H200: 132 multiprocessors at 1.98 GHz, HBM3e."""


def floors() -> dict[str, float]:
    """Return seconds of the campaign that each resource of an H200 alone would take."""
    count = len(TRAJECTORIES) * TRIALS
    return {
        name: count * of_trial / H200[name]
        for name, of_trial in (("integer", INTEGER), ("floating", FLOATING), ("bytes", BYTES))
    }


def main() -> int:
    """Print the floors; time the campaign at several batches."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu", description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS)
    parser.add_argument("--anyway", action="store_true", help="on whatever device there is")
    options = parser.parse_args()
    floor = floors()
    print("floor of one H200 [s]: " + ", ".join(f"{name} {seconds:.3f}" for name, seconds in floor.items()))
    device = jax.devices()[0]
    if device.platform == "cpu" and not options.anyway:
        print("no graphics processor here")
        return 0
    experiment, rows = Experiment.load("barreto2016"), []
    for batch in (64, 256, 1024):
        run = lambda trials, batch=batch: montecarlo(  # noqa: E731
            experiment, trials=trials, estimators=["central"], dtype="float32", batch=batch, devices=[device]
        )
        run(options.trials)  # compile, and the same shapes
        start = time.perf_counter()
        run(options.trials)
        seconds = (time.perf_counter() - start) * TRIALS / options.trials
        rows.append([str(batch), f"{seconds:.2f}", f"{seconds / max(floor.values()):.1f}"])
    print(device.device_kind)
    print(text_table(["trials at once", "campaign, s", "times the largest floor"], rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
