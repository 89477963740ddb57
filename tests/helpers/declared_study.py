"""The study of wrong declarations: what the laboratory's people declare is wrong, and each method must say so.

A cell is one clean run of tests/helpers/laboratory.py with one wrong declaration, identified from its file and experiment.

    python -m tests.helpers.declared_study --runs 2    # some minutes of processor time
"""

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.helpers.laboratory import NOISE, measure
from tests.helpers.laboratory_files import document, source, write
from tests.helpers.laboratory_mechanics import MASS
from tests.helpers.trouble_study import FIRST, METHODS, begin


class Wrong(NamedTuple):
    """A declaration, with what the run has instead."""

    words: str
    named: str
    """Words of a warning that names it; '': nothing may be said."""
    options: dict
    """Of :func:`tests.helpers.laboratory.measure`."""
    sources: tuple = ()
    """Arguments of :func:`tests.helpers.laboratory_files.source`, a source each."""
    sigma_mass: float = 0.0
    """Standard uncertainty that the mass is declared with [kg]; 0: it is exact."""


HEAVIER = {"mass_error": 0.01 * MASS}
GAIN = {"cell_gain": (0.02,) * 3 + (0.0,) * 3}
CASES = (
    Wrong("mass, 1 % too large, exact", "(mass)", HEAVIER),
    Wrong("mass, 1 % too large, u = 0.1 %", "the mass comes to", HEAVIER, sigma_mass=0.001 * MASS),
    Wrong("mass, 1 % too large, u = 1 %", "", HEAVIER, sigma_mass=0.01 * MASS),
    Wrong("r_CG, off by 2 mm, u = 0.15 mm", "the centre of gravity on axis 1 comes to", {"r_cg_error": (2e-3, 0, 0)}),
    Wrong(
        "delay of 2 ms, declared 0, u = 0.1 ms", "the delay comes to", {"imu_delay": 2e-3},
        (("delay", "omega", "delay", 1e-4),),
    ),
    Wrong(
        "IMU turned by 0.5°, declared 0, u = 0.05°", "the rotation vector of the IMU on axis 1 comes to",
        {"imu_turn": (np.radians(0.5), 0, 0)}, (("turn", "omega", "misalignment", [np.radians(0.05)] * 3),),
    ),
    Wrong(
        "gains of the force, 2 %, declared 0, u = 0.1 %", "the error of the load cell's matrix comes to", GAIN,
        (("gain", "F", "scale", [0.1] * 3),), sigma_mass=0.001 * MASS,
    ),
    Wrong(
        "noise of the moment, declared 3 times too small", "M has noise of", {},
        (("M_noise", "M", "precision", [NOISE["moment"] / 3] * 3),),
    ),
    Wrong(
        "noise of the gyro, declared 3 times too large", "omega has noise of", {},
        (("gyro_noise", "omega", "precision", [NOISE["gyro"] * 3] * 3),),
    ),
    Wrong("delay of 5 ms and all gains 3 % off, mass u = 0.1 %", "comes to",
          {"imu_delay": 5e-3, "cell_gain": (0.03,) * 6}, sigma_mass=0.001 * MASS),
)  # fmt: skip


def identified(case: Wrong, seed: int, method: str):
    """The result of one run."""
    from uq.experiment.experiment import Experiment
    from uq.runs.identification.identify_files import identify_files

    measured = measure(seed, **case.options)
    content = document(measured, method, [source(*table) for table in case.sources])
    if case.sigma_mass:
        content["body"].pop("mass")
        content["scale"] = {"mass": f"{measured.mass} kg", "standard_uncertainty": f"{case.sigma_mass} kg"}
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "run.mcap", measured)
        return identify_files([path], Experiment.from_dict(content))


def row(case: Wrong, runs: int) -> str:
    """A line of the table: runs in which it is named, and in which the result is contradicted, by method."""
    cells = []
    for method in METHODS:
        results = [identified(case, FIRST + k, method) for k in range(runs)]
        if case.named:
            count = sum(any(case.named in text for text in result.warnings) for result in results)
        else:
            count = sum(bool(result.warnings) for result in results)
        cells.append((count, sum(bool(result.contradicted) for result in results)))
    named, contradicted = ("/".join(map(str, column)) for column in zip(*cells, strict=True))
    return f"| {case.words} | {named} | {contradicted} |"


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=2, help="of each case and method")
    asked = parser.parse_args(arguments)
    begin()
    print(f"| of {asked.runs} runs, {'/'.join(METHODS)} | named | contradicted |\n|---|---|---|")
    for case in CASES:
        print(row(case, asked.runs), flush=True)


if __name__ == "__main__":
    main()
