"""The study of undeclared errors: all drawn together at parts and multiples of their typical size, nothing declared of them.

A run is one of tests/helpers/laboratory.py with gains (common and by axis), cross-talk, axes of load cell and gyro, gyro scale, delay, mass,
accelerometer scale and the mounting's frequency off, identified from its file as ``inertia identify`` does. The oracle is
told the size, which is the best that a second interval can do.

    python -m tests.helpers.undeclared_study --runs 20 --sizes 0.3 1 3
"""

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.helpers.laboratory import measure
from tests.helpers.trouble_study import METHODS

FIRST = 900
"""Seed of the first run, apart from those of other studies."""
SILENT = 2.0
"""Half-widths of the second interval beyond which an answer that says nothing is silently wrong."""


class Answer(NamedTuple):
    """Both intervals of one run by one method, (6, 2), the oracle's second one, whether it was warned, and the truth."""

    first: np.ndarray
    second: np.ndarray
    oracle: np.ndarray
    warned: bool
    truth: np.ndarray


def drawn(seed: int, size: float) -> dict:
    """The laboratory's options: every error drawn anew, normal, ``size`` times its typical standard uncertainty."""
    generator = np.random.default_rng([FIRST, seed])

    def normal(sigma: float, count: int = 3) -> np.ndarray:
        return size * sigma * generator.normal(size=count)

    common = np.repeat(normal(0.0025, 2), 3)
    clean = measure(seed)
    full_scale = np.repeat([np.abs(clean.force).max(), np.abs(clean.moment).max()], 3)
    talk = normal(0.0015, 36).reshape(6, 6) * (1 - np.eye(6)) * np.outer(full_scale, 1 / full_scale)
    return {
        "cell_gain": tuple(common + normal(0.0025, 6)), "cross_talk": talk, "cell_turn": tuple(normal(0.005)),
        "gyro_scale": tuple(normal(0.003)), "gyro_turn": tuple(normal(0.005)), "imu_delay": float(normal(0.001, 1)[0]),
        "mass_error": float(normal(0.001 * clean.mass, 1)[0]), "accelerometer_scale": tuple(normal(0.003)),
        "flex_frequency": 50.0 / np.sqrt(size),
    }  # fmt: skip


def answers(seed: int, size: float) -> dict[str, Answer]:
    """One run's answers, by method."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from tests.helpers.laboratory_files import document, write
    from uq.experiment.experiment import Experiment
    from uq.experiment.undeclared_table import UndeclaredTable
    from uq.identification.identify_files import identify_files
    from uq.identification.undeclared import with_undeclared
    from uq.recorded.load_run import load_run

    measured, by_method = measure(seed, **drawn(seed, size)), {}
    told = UndeclaredTable(
        **{name: size * x for name, x in UndeclaredTable().to_dict().items() if name != "mounting_frequency"},
        mounting_frequency=50.0 / np.sqrt(size),
    )
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "run.mcap", measured)
        for method in METHODS:
            experiment = Experiment.from_dict(document(measured, method))
            result = identify_files([path], experiment)
            if result.undeclared is None:
                continue
            run = load_run(path, experiment.recording)
            oracle = with_undeclared(result, [run], replace(experiment, undeclared=told))
            by_method[method] = Answer(
                first=result.interval95, second=result.interval95_with_undeclared,
                oracle=oracle.interval95_with_undeclared, warned=bool(result.warnings), truth=measured.truth,
            )  # fmt: skip
    return by_method


def score(interval: np.ndarray, truth: np.ndarray) -> float:
    """Mean interval score at 95 % (Gneiting and Raftery 2007, doi:10.1198/016214506000001437, eq. 43)."""
    low, high = interval.T
    missed = np.maximum(low - truth, 0) + np.maximum(truth - high, 0)
    return float(np.mean(high - low + 2 / 0.05 * missed))


def row(size: float, method: str, told: Sequence[Answer]) -> str:
    """A line of the table."""
    holds = {
        name: np.mean([(i[:, 0] <= a.truth) & (a.truth <= i[:, 1]) for a in told for i in [getattr(a, name)]])
        for name in ("first", "second", "oracle")
    }
    off = [np.abs(a.second.mean(axis=1) - a.truth) / (np.ptp(a.second, axis=1) / 2) for a in told]
    silent = sum(bool((o > SILENT).any()) and not a.warned for o, a in zip(off, told, strict=True))
    ratio = np.mean([score(a.second, a.truth) for a in told]) / np.mean([score(a.oracle, a.truth) for a in told])
    covered = " | ".join(f"{100 * holds[name]:.0f}" for name in ("first", "second", "oracle"))
    warned = sum(a.warned for a in told)
    return f"| {size:g} | {method} | {len(told)} | {covered} | {silent} | {warned} | {ratio:.2f} |"


def table(found: Mapping[float, Sequence[Mapping[str, Answer]]]) -> str:
    """The table of docs/explanation/intervals.md."""
    head = "| size | method | runs | first, % | second, % | told, % | silent | warned | score |\n|" + "---|" * 9
    rows = [
        row(size, method, [answer[method] for answer in runs if method in answer])
        for size, runs in found.items() for method in METHODS
    ]  # fmt: skip
    return "\n".join([head, *rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.3, 1.0, 3.0])
    parser.add_argument("--processes", type=int, default=2)
    arguments = parser.parse_args()
    found = {}
    with ProcessPoolExecutor(arguments.processes) as pool:
        for size in arguments.sizes:
            found[size] = list(pool.map(answers, range(arguments.runs), [size] * arguments.runs))
    print(table(found))


if __name__ == "__main__":
    main()
