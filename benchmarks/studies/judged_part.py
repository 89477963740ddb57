"""Whether the judge names of a long run's first part what it names of all of it.

    python -m benchmarks.studies.judged_part    # 12 minutes of processor time, 3.4 GB

Runs of tests/helpers/laboratory.py of twelve minutes, a motion up to 2.5 Hz, each with one error of the rig that shifts
some component of plain least squares by one standard uncertainty of a clean run of 30 s.
"""

import argparse
from dataclasses import replace
from unittest.mock import patch

import jax

from identify.judge import judged_part
from tests.helpers.laboratory import Setup, measure
from tests.helpers.laboratory_runs import identified
from tests.helpers.troubles import TROUBLES, size_for

NAMES = ("delay", "IMU axes", "r_CG", "gyro scale", "cable")
SECONDS, PACE, SHIFT = 720.0, 1.3, 1.0
EVERYTHING = (1e9, 1e9)


def causes(measured) -> tuple[str, ...]:
    """Return what is named of a run, and the declared quantities that it places elsewhere."""
    result = identified(measured)
    return (*(cause.cause for cause in result.consistency), *(record.quantity for record in result.declarations))


def main() -> None:
    """Print what is named of each run, by its first part and by all of it."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--runs", type=int, default=4, help="runs of each error")
    arguments.add_argument("--seconds", type=float, default=SECONDS, help="how long a run is")
    options = arguments.parse_args()
    jax.config.update("jax_enable_x64", True)
    u, same, count = identified(measure(0)).standard_uncertainty, 0, 0
    for name in ("nothing", *NAMES):
        for seed in range(options.runs):
            trouble = TROUBLES.get(name)
            more = {} if trouble is None else trouble.options(size_for(trouble, SHIFT, u, seed), seed)
            measured = measure(seed, replace(Setup(), seconds=options.seconds, pace=PACE), **more)
            first = causes(measured)
            with patch.object(judged_part, "PERIODS", EVERYTHING):
                every = causes(measured)
            same, count = same + (first == every), count + 1
            print(f"{name} {seed}: first part {first}, all {every}", flush=True)
    print(f"the same of {same} of {count} runs")


if __name__ == "__main__":
    main()
