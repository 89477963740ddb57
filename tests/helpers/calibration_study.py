"""The study of calibrations: a rig with all typical errors, one known body, four others.

Each rig of tests/helpers/laboratory.py draws gains (common and by axis), cross-talk, axes of load cell and gyro, gyro scale, delay,
accelerometer scale and the mounting's frequency at a part or a multiple of their typical sizes. Three runs of a known body, whose
drawing errs within its tolerances, calibrate it; four other bodies, a run each, are identified with that calibration and
without one.

    python -m tests.helpers.calibration_study --rigs 20 --sizes 0.3 1 3
"""

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.helpers.interval_quality import quality
from tests.helpers.laboratory import INERTIA, MASS, R_CG, measure
from tests.helpers.undeclared_study import ERRORS, drawn, silent

COMPONENTS = ("I11", "I12", "I13", "I22", "I23", "I33")
MOTIONS = ({}, {"swing": (1.0, 0.7, 0.5), "pace": 0.8}, {"swing": (0.6, 1.0, 0.8), "pace": 1.1})
OF_THE_RIG = tuple(name for name in ERRORS if name != "mass")
TOLERANCE = 0.001
"""Standard uncertainty of the known body's figures, over its mass and its largest moment."""
PLACE = 1e-4
"""Standard uncertainty of its centre of gravity [m]."""
METHODS = ("source", "joint")


class CalibratedAnswer(NamedTuple):
    """Both intervals of one body by one method, (6, 2), whether it was warned, and the truth."""

    first: np.ndarray
    second: np.ndarray
    warned: bool
    truth: np.ndarray


def known_body(path: Path, rng: np.random.Generator, wrong: dict[str, float] | None = None) -> Path:
    """A CAD report of the laboratory's usual body, its figures drawn within their uncertainties.

    Args:
        path: of the file.
        rng: generator of the figures' errors.
        wrong: factors on figures (mass, I11, …) that are wrong.
    """
    factors, largest = wrong or {}, INERTIA.max()
    mass = MASS * (1 + TOLERANCE * rng.normal()) * factors.get("mass", 1.0)
    centre = R_CG + PLACE * rng.normal(size=3)
    lines = ['name = "standard"', "[cad]", 'about = "CG"', 'products = "tensor"']
    lines += [f"mass = {_figure(mass, TOLERANCE * MASS, 'kg')}"]
    lines += [f"cg = [{', '.join(_figure(x, PLACE, 'm') for x in centre)}]", "[cad.inertia]"]
    for name, value in zip(COMPONENTS, INERTIA[np.triu_indices(3)], strict=True):
        stated = (value + TOLERANCE * largest * rng.normal()) * factors.get(name, 1.0)
        lines.append(f"{name} = {_figure(stated, TOLERANCE * largest, 'kg*m^2')}")
    path.write_text("\n".join(lines) + "\n")
    return path


def _figure(value: float, u: float, unit: str) -> str:
    return f'{{ value = "{value:.12g} {unit}", standard_uncertainty = "{u:.6g} {unit}" }}'


def other_body(rng: np.random.Generator) -> dict:
    """Another body: of other size, turned."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return {"inertia": rng.uniform(0.4, 1.2) * turn @ INERTIA @ turn.T, "mass": MASS * rng.uniform(0.7, 1.2)}


def calibrated(folder: Path, seed: int, rig: dict, method: str, wrong: dict[str, float] | None = None):
    """The calibration of a rig by three runs of the known body."""
    from tests.helpers.laboratory_files import document, write
    from uq.bodies.calibration.calibrate_files import calibrate_files
    from uq.experiment.experiment import Experiment

    rng = np.random.default_rng([77, seed])
    body = known_body(folder / "standard.toml", rng, wrong)
    runs = [measure(10_000 + 10 * seed + k, **rig, **motion) for k, motion in enumerate(MOTIONS)]
    paths = [write(folder / f"standard{k}.mcap", run) for k, run in enumerate(runs)]
    return calibrate_files([(body, paths)], Experiment.from_dict(document(runs[0], method)))


def answers_of_rig(
    seed: int, size: float, method: str
) -> list[tuple[CalibratedAnswer | None, CalibratedAnswer | None]]:
    """Answers on four bodies, with the rig's calibration and without."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from tests.helpers.laboratory_files import document, write
    from uq.experiment.experiment import Experiment
    from uq.files.toml_text import toml_text

    rig = {key: value for key, value in drawn(seed, size, OF_THE_RIG).items() if key != "mass_error"}
    every = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(toml_text(calibrated(folder, seed, rig, method).sources()))
        rng = np.random.default_rng([78, seed])
        for number in range(4):
            run = measure(20_000 + 10 * seed + number, **rig, **other_body(rng), **MOTIONS[number % len(MOTIONS)])
            path, content = write(folder / f"body{number}.mcap", run), document(run, method)
            every.append(tuple(
                _answer(path, Experiment.from_dict(content | include, folder), run.truth)
                for include in ({"include": ["rig.toml"]}, {})
            ))  # fmt: skip
    return every


def _answer(path: Path, experiment, truth: np.ndarray) -> CalibratedAnswer | None:
    """What is said of one body; None: it is refused."""
    from identify.exceptions import RunError
    from uq.runs.identification.identify_files import identify_files

    try:
        result = identify_files([path], experiment)
    except RunError:
        return None
    return CalibratedAnswer(result.interval95, result.conventional_bound, bool(result.warnings), truth)


def row(label: str, size: float, method: str, answers: list[CalibratedAnswer | None]) -> str:
    """A line of the table."""
    refused, answers = answers.count(None), [answer for answer in answers if answer is not None]
    truths = np.array([answer.truth for answer in answers])
    first, second = (
        quality(np.array([getattr(answer, name) for answer in answers]), truths) for name in ("first", "second")
    )
    half = np.array([np.ptp(answer.first, axis=1) / 2 / answer.truth[[0, 3, 5]].max() for answer in answers])
    wide = np.array([np.ptp(answer.second, axis=1) / 2 / answer.truth[[0, 3, 5]].max() for answer in answers])
    cells = [
        label, f"{size:g}", method, str(len(answers)), f"{first.held:.1f}", f"{second.held:.1f}",
        f"{first.error_over_u:.2f}", f"{second.error_over_u:.2f}", f"{100 * np.median(half):.2f}",
        f"{100 * np.median(wide):.2f}", str(sum(map(silent, answers))), str(sum(answer.warned for answer in answers)), str(refused),
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


HEAD = (
    "", "size", "method", "bodies", "interval, %", "bound, %", "error/u, interval", "error/u, bound",
    "half-width, interval, %", "half-width, bound, %", "silent", "warned", "refused",
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rigs", type=int, default=20)
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.3, 1.0, 3.0])
    parser.add_argument("--methods", nargs="+", default=METHODS)
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    print(f"| {' | '.join(HEAD)} |\n|" + "---|" * len(HEAD))
    with ProcessPoolExecutor(arguments.processes) as pool:
        for size in arguments.sizes:
            for method in arguments.methods:
                rigs = pool.map(partial(answers_of_rig), range(arguments.rigs), repeat(size), repeat(method))
                pairs = [pair for rig in rigs for pair in rig]
                print(row("calibrated", size, method, [pair[0] for pair in pairs]), flush=True)
                print(row("not calibrated", size, method, [pair[1] for pair in pairs]), flush=True)


if __name__ == "__main__":
    main()
