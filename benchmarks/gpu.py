"""The paper's campaign on one graphics processor, by samples (float32 draws) and on sums. ``python -m benchmarks.gpu``.

By samples it stands beside its floor. On a machine without such a processor it says so, and runs on what there is if
``--anyway`` is given.
"""

import argparse
import time

import jax

jax.config.update("jax_enable_x64", True)

from benchmarks.contenders import TRAJECTORIES, engines, trials_of  # noqa: E402
from identify.display.text_tables import text_table  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402

SAMPLES, TRIALS = 72_000, 10_000
INTEGER = SAMPLES * 9 / 2 * 80
"""Integer operations of a trial: 20 rounds of addition, rotation and exclusive or, and the keys, a pair of draws."""
FLOATING = SAMPLES * (9 / 2 * 45 + 4 * (30 + 9 * 15))
"""Multiply-adds of a trial: Box–Muller; for each of four groups signals, features, products of 9 of them with 15."""
BYTES = SAMPLES * 4 * (9 * 2 + 4 * 9 * 2)
"""Memory traffic of a trial in float32: noise written and read, for each of four groups a record written and read."""
H200 = {"integer": 132 * 64 * 1.98e9, "floating": 132 * 128 * 1.98e9, "bytes": 4.8e12}
"""Operations a second and bytes a second of one H200: 132 multiprocessors at 1.98 GHz, HBM3e."""
BATCHES = {"samples": (64, 256, 1024), "sums": (250, 2500, 10_000)}


def floors() -> dict[str, float]:
    """Return seconds of the campaign by samples that each resource of an H200 alone would take."""
    count = len(TRAJECTORIES) * TRIALS
    operations = {"integer": INTEGER, "floating": FLOATING, "bytes": BYTES}
    return {name: count * of_trial / H200[name] for name, of_trial in operations.items()}


def main() -> None:
    """Print the floors; time the campaign at several batches."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gpu", description=__doc__)
    parser.add_argument("--trials", type=int, default=TRIALS, help=f"trials that are run, for {TRIALS} ({TRIALS})")
    parser.add_argument("--anyway", action="store_true", help="on whatever device there is")
    options = parser.parse_args()
    floor, device = floors(), jax.devices()[0]
    print("floor of one H200 by samples [s]: " + ", ".join(f"{name} {value:.3f}" for name, value in floor.items()))
    if device.platform == "cpu" and not options.anyway:
        print("no graphics processor here")
        return
    experiment, rows = Experiment.load("barreto2016"), []
    for engine, dtype in (("samples", "float32"), ("sums", "float64")):
        prepared = engines(experiment, engine, dtype)
        for batch in BATCHES[engine]:
            trials_of(prepared, options.trials, [device], batch)  # compile, and the same shapes
            start = time.perf_counter()
            trials_of(prepared, options.trials, [device], batch)
            seconds = (time.perf_counter() - start) * TRIALS / options.trials
            beside = f"{seconds / max(floor.values()):.1f}" if engine == "samples" else ""
            rows.append([engine, str(batch), f"{seconds:.2f}", beside])
    print(device.device_kind)
    print(text_table(["engine", "trials at once", "campaign, s", "times the largest floor"], rows))


if __name__ == "__main__":
    main()
