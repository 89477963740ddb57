"""The study of 95 % intervals where every error is declared: how often it holds the truth, and how often a sound run is warned.

Four kinds of body and motion of tests/helpers/laboratory.py, 10 to 60 s at 50 to 1,000 Hz. Each run draws, from what its experiment declares,
offsets, r_CG, mass, gains, cross-talk, axes of load cell and gyro, gyro scale and delay; the experiment says ``undeclared = "none"``.
The methods take turns, so that each identifies a third of the runs.

    python -m tests.helpers.coverage_study --runs 400 --out out/coverage.jsonl
"""

import argparse
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import binom

from tests.helpers.interval_quality import quality
from tests.helpers.laboratory import FULL_SCALE, Measured, Setup, measure
from tests.helpers.laboratory_files import document, source, write
from tests.helpers.laboratory_runs import BAND
from tests.helpers.trouble_study import COMPONENTS, METHODS, begin

FIRST = 3000
"""Seed of the first run, apart from those of other studies."""
SIGMA = {
    "F_gain": ("F", "scale", 0.003), "M_gain": ("M", "scale", 0.003), "cross_talk": ("wrench", "cross_talk", 0.001),
    "cell_axes": ("wrench", "misalignment", 0.003), "gyro_scale": ("omega", "scale", 0.003),
    "gyro_axes": ("omega", "misalignment", 0.003), "late": ("omega", "delay", 0.001),
}  # fmt: skip
"""Target, kind and standard deviation of each declared error beside those that every run of the laboratory has."""
SIGMA_MASS = 0.001
"""Standard uncertainty of the mass, in parts."""
LIMIT = 0.001
"""Chance of as few intervals that hold the truth below which a component counts as not covered."""


class Kind(NamedTuple):
    """A body and its motion."""

    words: str
    setup: Setup
    sampled: tuple[tuple[float, int], ...]
    """Seconds and rates that its runs take in turn [s, Hz]."""


FLAT = np.array([[0.110, 0.002, 0.001], [0.002, 0.140, -0.001], [0.001, -0.001, 0.240]])
COMPACT = np.array([[0.030, 0.001, -0.002], [0.001, 0.034, 0.001], [-0.002, 0.001, 0.028]])
KINDS = (
    Kind("long body, turned about its centre of gravity", Setup(still=True), ((10, 400), (60, 100))),
    Kind("long body on a lever, half as fast", Setup(pace=0.5), ((20, 1000), (60, 50))),
    Kind("flat body, which hardly turns about one axis", Setup(inertia=FLAT, mass=8.0, swing=(0.2, 1.2, 1.2)),
         ((10, 1000), (30, 200))),
    Kind("compact body, half as fast again", Setup(inertia=COMPACT, mass=5.0, pace=1.5), ((15, 200), (30, 400))),
)  # fmt: skip


class Answer(NamedTuple):
    """What one run led to."""

    number: int
    kind: int
    method: str
    ends: list[list[float]]
    """Of the interval of each component [kg·m²]."""
    truth: list[float]
    warnings: list[str]


def measured(number: int) -> tuple[int, Measured]:
    """The kind and the run of a number, with every error drawn."""
    kind = number % len(KINDS)
    generator, setup = np.random.default_rng([FIRST, number]), KINDS[kind].setup
    # rates and durations change slower than kinds and methods, which have no divisor in common
    seconds, rate = KINDS[kind].sampled[number // (len(KINDS) * len(METHODS)) % 2]
    size = {name: sigma for name, (_, _, sigma) in SIGMA.items()}
    talk = size["cross_talk"] * generator.standard_normal((6, 6)) * (1 - np.eye(6))
    errors = {
        "cell_gain": tuple(size["F_gain"] * generator.standard_normal(6)),
        "cross_talk": talk * FULL_SCALE[:, None] / FULL_SCALE,
        "cell_turn": tuple(size["cell_axes"] * generator.standard_normal(3)),
        "gyro_scale": tuple(size["gyro_scale"] * generator.standard_normal(3)),
        "gyro_turn": tuple(size["gyro_axes"] * generator.standard_normal(3)),
        "imu_delay": size["late"] * generator.standard_normal(),
        "mass_error": SIGMA_MASS * setup.mass * generator.standard_normal(),
    }
    return kind, measure(FIRST + number, replace(setup, seconds=seconds, rate=rate, **errors))


def declared(run: Measured, method: str) -> dict:
    """The experiment file's content, with every error declared."""
    sources = []
    for name, (target, kind, sigma) in SIGMA.items():
        in_unit = 100 * sigma if kind == "scale" else sigma
        sources.append(source(name, target, kind, in_unit if kind in ("delay", "cross_talk") else [in_unit] * 3))
    content = document(run, method, sources) | {"undeclared": "none"}
    content["estimator"][0]["band"] = f"{BAND * run.setup.pace} Hz"
    content["scale"] = {
        "mass": content["body"].pop("mass"), "standard_uncertainty": f"{SIGMA_MASS * run.setup.mass} kg"
    }  # fmt: skip
    return content


def answers(numbers: Sequence[int]) -> Iterator[Answer]:
    """Identify runs, each by the method that has its turn."""
    from uq.experiment.experiment import Experiment
    from uq.runs.identification.identify_files import identify_files

    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            kind, run = measured(number)
            method = METHODS[number % len(METHODS)]
            path = write(Path(folder) / "run.mcap", run)
            result = identify_files([path], Experiment.from_dict(declared(run, method)))
            yield Answer(number, kind, method, result.interval95.tolist(), run.truth.tolist(), list(result.warnings))


def row(words: str, some: Sequence[Answer]) -> str:
    """A line of the table."""
    ends, truth = (np.array([getattr(answer, name) for answer in some]) for name in ("ends", "truth"))
    counts = ((ends[..., 0] <= truth) & (truth <= ends[..., 1])).sum(axis=0)
    shown = quality(ends, truth)
    worst = int(counts.argmin())
    least = int(binom.ppf(LIMIT, len(some), 0.95))
    return (
        f"| {words} | {len(some)} | {shown.held:.1f} | {COMPONENTS[worst]} {counts[worst]} (≥ {least}) "
        f"| {shown} | {sum(bool(answer.warnings) for answer in some)} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument(
        "--out", type=Path, default=Path("out/coverage.jsonl"), help="answers; runs that it has are not done again"
    )
    arguments = parser.parse_args()
    begin()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.touch()
    stored = [Answer(**json.loads(line)) for line in arguments.out.read_text("utf-8").splitlines()]
    done = {answer.number for answer in stored}
    with arguments.out.open("a", encoding="utf-8") as file:
        for answer in answers([number for number in range(arguments.runs) if number not in done]):
            file.write(json.dumps(answer._asdict()) + "\n")
            file.flush()
            stored.append(answer)
    print("| runs | number | held, % | worst component (0.1 % limit) | error/u | score, % | warned |\n|" + "---|" * 7)
    for method in METHODS:
        print(row(method, [answer for answer in stored if answer.method == method]))
    for number, kind in enumerate(KINDS):
        print(row(kind.words, [answer for answer in stored if answer.kind == number]))
    print(row("all", stored))


if __name__ == "__main__":
    main()
