"""The study of undeclared errors: drawn at parts and multiples of their typical size, nothing declared of them.

A run is one of tests/helpers/laboratory.py with gains (common and by axis), cross-talk, axes of load cell and gyro, gyro scale, delay, mass,
accelerometer scale and the mounting's frequency off: all of them, each alone, or two at random. It is identified from its file as
``inertia identify`` does. The oracle knows the size of all, which is the best that a bound can do that does not know which
errors there are.

    python -m tests.helpers.undeclared_study --runs 20 --sizes 0.3 1 3
    python -m tests.helpers.undeclared_study --runs 20 --single
    python -m tests.helpers.undeclared_study --runs 20 --pairs 20
"""

import argparse
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tests.helpers.interval_quality import interval_score, quality
from tests.helpers.laboratory import Measured, measure
from tests.helpers.trouble_study import METHODS

FIRST = 900
"""Seed of the first run, apart from those of other studies."""
SILENT = 2.0
"""Half-widths of the bound beyond which an answer that says nothing is silently wrong."""


class Answer(NamedTuple):
    """Both intervals of one run by one method, (6, 2), the oracle's second one, whether it was warned, and the truth."""

    first: np.ndarray
    second: np.ndarray
    oracle: np.ndarray
    warned: bool
    truth: np.ndarray


def _normal(generator: np.random.Generator, size: float, sigma: float, shape: object = None) -> np.ndarray:
    return size * sigma * generator.normal(size=shape)


def _cross_talk(normal: Callable, clean: Measured) -> dict:
    full_scale = np.repeat([np.abs(clean.force).max(), np.abs(clean.moment).max()], 3)
    return {"cross_talk": normal(0.0015, (6, 6)) * (1 - np.eye(6)) * np.outer(full_scale, 1 / full_scale)}


ERRORS: dict[str, Callable[[Callable, Measured], dict]] = {
    "gain of force": lambda normal, clean: {"cell_gain": np.repeat([normal(0.0025), 0.0], 3)},
    "gain of moment": lambda normal, clean: {"cell_gain": np.repeat([0.0, normal(0.0025)], 3)},
    "gains by axis": lambda normal, clean: {"cell_gain": normal(0.0025, 6)},
    "cross-talk": _cross_talk,
    "load cell axes": lambda normal, clean: {"cell_turn": tuple(normal(0.005, 3))},
    "gyro scale": lambda normal, clean: {"gyro_scale": tuple(normal(0.003, 3))},
    "gyro axes": lambda normal, clean: {"gyro_turn": tuple(normal(0.005, 3))},
    "delay": lambda normal, clean: {"imu_delay": float(normal(0.001))},
    "mass": lambda normal, clean: {"mass_error": float(normal(0.001 * clean.mass))},
    "accelerometer scale": lambda normal, clean: {"accelerometer_scale": tuple(normal(0.003, 3))},
    "mounting": lambda normal, clean: {"flex_frequency": 50.0 / np.sqrt(abs(normal(1.0)))},
}
"""The laboratory's options for each error, from a function that draws normal numbers of a standard deviation (times the size)."""


def drawn(seed: int, size: float, names: Sequence[str]) -> dict:
    """The laboratory's options: the named errors, normal, ``size`` times their typical standard uncertainty."""
    clean, options = measure(seed), {"cell_gain": np.zeros(6)}
    for name in names:
        generator = np.random.default_rng([FIRST, seed, list(ERRORS).index(name)])
        normal = partial(_normal, generator, size)
        for key, value in ERRORS[name](normal, clean).items():
            options[key] = options[key] + value if key in options else value
    return options | {"cell_gain": tuple(options["cell_gain"])}


def answers(seed: int, size: float, names: Sequence[str]) -> dict[str, Answer]:
    """One run's answers, by method."""
    import jax

    jax.config.update("jax_enable_x64", True)
    from tests.helpers.changed_result import with_typical
    from tests.helpers.laboratory_files import document, write
    from uq.experiment.experiment import Experiment
    from uq.runs.identification.identify_files import identify_files

    measured, by_method = measure(seed, **drawn(seed, size, names)), {}
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder) / "run.mcap", measured)
        for method in METHODS:
            result = identify_files([path], Experiment.from_dict(document(measured, method)))
            if result.undeclared is None:
                continue
            # effects are of first order, so those of another size are so many times as large
            rows = [replace(row, changes=size * row.changes) for row in result.undeclared.rows]
            oracle = with_typical(result, rows)
            by_method[method] = Answer(
                first=result.interval95, second=result.conventional_bound,
                oracle=oracle.conventional_bound, warned=bool(result.warnings), truth=measured.truth,
            )  # fmt: skip
    return by_method


def silent(answer: Answer) -> bool:
    """Return whether some component is off by more than so many half-widths of the bound, without a warning."""
    off = np.abs(answer.second.mean(axis=1) - answer.truth) / (np.ptp(answer.second, axis=1) / 2)
    return bool((off > SILENT).any()) and not answer.warned


def row(label: str, size: float, runs: Sequence[Mapping[str, Answer]]) -> str:
    """A line of the table; in a cell the three methods."""
    cells = []
    for method in METHODS:
        stated = [by_method[method] for by_method in runs if method in by_method]
        truths = np.array([answer.truth for answer in stated])
        intervals = [np.array([getattr(answer, name) for answer in stated]) for name in ("first", "second", "oracle")]
        qualities = [quality(ends, truths) for ends in intervals]
        _, bound, exact_size = (interval_score(ends, truths).mean() for ends in intervals)
        cells.append([
            *(f"{each.held:.0f}" for each in qualities), *(f"{each.error_over_u:.2g}" for each in qualities[:2]),
            f"{bound / exact_size:.2f}", *(f"{each.score:.2g}" for each in qualities[:2]),
            str(sum(map(silent, stated))), str(sum(answer.warned for answer in stated)),
        ])  # fmt: skip
    return " | ".join([f"| {label}", f"{size:g}", str(len(runs)), *map("/".join, zip(*cells, strict=True))]) + " |"


HEAD = (
    "error", "size", "runs", "interval, %", "bound, %", "exact size, %", "error/u, interval", "error/u, bound", "score",
    "score, interval, %", "score, bound, %", "silent", "warned",
)  # fmt: skip
"""Columns: *score* is the bound's over that of the exact size, in % it is over the largest moment."""


def pairs(count: int) -> list[tuple[str, str]]:
    """Return so many different pairs of errors, at random."""
    generator = np.random.default_rng(FIRST)
    every = [(a, b) for number, a in enumerate(ERRORS) for b in list(ERRORS)[number + 1 :]]
    return [every[i] for i in sorted(generator.choice(len(every), count, replace=False))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.3, 1.0, 3.0])
    parser.add_argument("--processes", type=int, default=2)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--single", action="store_true", help="each error alone")
    which.add_argument("--pairs", type=int, help="so many random pairs")
    arguments = parser.parse_args()
    if arguments.single:
        cases = [(name,) for name in ERRORS]
    else:
        cases = pairs(arguments.pairs) if arguments.pairs else [tuple(ERRORS)]
    print(f"| {' | '.join(HEAD)} |\n|" + "---|" * len(HEAD))
    with ProcessPoolExecutor(arguments.processes) as pool:
        for size in arguments.sizes:
            every = []
            for names in cases:
                runs = list(pool.map(answers, range(arguments.runs), repeat(size), repeat(names)))
                label = "all" if len(names) == len(ERRORS) else ", ".join(names)
                print(row(label, size, runs), flush=True)
                every += runs
            if len(cases) > 1:
                print(row("together", size, every), flush=True)


if __name__ == "__main__":
    main()
