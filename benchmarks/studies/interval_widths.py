"""Both intervals of the examples' experiments, and what a user must declare to make them one.

``python -m benchmarks.studies.interval_widths [FOLDER]``: each experiment of ``inertia examples`` that can be
simulated, one run of it, without the line ``undeclared = "none"``, by each method, and ``throws.toml`` with the
recordings of a folder (:mod:`benchmarks.studies.throws`). The conventional bound rests on typical figures, so
that one run tells its width.
"""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.resources import as_file, files
from pathlib import Path

import jax
import numpy as np

from identify.display.rounding import significant
from identify.results.ledger import Ledger
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.experiment.experiment import Experiment
from uq.files.mistakes import MISTAKES
from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.static_centre import centre_file

EXAMPLES = ("t1-10s", "designed", "many-errors", "laboratory", "robot")
METHODS = ("source", "gls", "joint")
ENOUGH = 0.1
"""Part by which the bound may exceed the interval for both to count as one."""


def rows(name: str) -> Iterator[str]:
    """Yield a line of the table for each method."""
    with tempfile.TemporaryDirectory() as folder:
        for file in (files("uq") / "examples").iterdir():
            (Path(folder) / file.name).write_text(file.read_text("utf-8").replace('undeclared = "none"', ""), "utf-8")
        experiment, path = Experiment.load(Path(folder) / f"{name}.toml"), Path(folder) / "run.mcap"
        simulate(experiment, seed=1).write(path)
        for method in METHODS:
            yield row_of_runs(name, [path], experiment, method)


def rows_of_throws(folder: Path) -> Iterator[str]:
    """Yield the line of ``throws.toml`` with all recordings ``BODY_NUMBER.mcap`` of each body of a folder."""
    with as_file(files("uq") / "examples" / "throws.toml") as document:
        experiment = Experiment.load(document)
    for body in sorted({path.stem.rsplit("_", 1)[0] for path in folder.glob("*.mcap")}):
        yield row_of_runs(f"throws, {body}", sorted(folder.glob(f"{body}_*.mcap")), experiment, "source")


def row_of_runs(name: str, paths: Sequence[Path], experiment: Experiment, method: str) -> str:
    """Return the line of some runs, identified together."""
    try:
        result = identify_files(paths, experiment, method=method)
    except MISTAKES as error:
        return f"| {name}, {method} | {error} |{' |' * 6}"
    half = result.coverage_factors * result.parameters.standard_uncertainty
    names = [f"{component}, g·m²" for component in COMPONENTS]
    return row(f"{name}, {method}", names, GRAM_METRE, half, 4, result.undeclared)


def row_of_poses() -> str:
    """Return the line of the static poses of ``weigh.toml``."""
    examples = files("uq") / "examples"
    with as_file(examples / "weigh.csv") as table, as_file(examples / "weigh.toml") as document:
        result = centre_file(table, Experiment.load(document))
    half = result.coverage_factor * result.standard_uncertainty
    return row("weigh, `inertia centre`", [f"CG on b{k}, mm" for k in (1, 2, 3)], 1e3, half, 1, result.undeclared)


def row(label: str, names: Sequence[str], unit: float, half: np.ndarray, first: int, undeclared: Ledger | None) -> str:
    """Return the line of one result, of the parameters whose bound is widest for its interval, and widest.

    Args:
        label: the experiment and method.
        names: of the parameters that are looked at, with their unit.
        unit: how many of it are one in SI.
        half: half the 95 % interval of all ten parameters, SI.
        first: number of the first of these parameters.
        undeclared: the errors that the bound adds.
    """
    added = undeclared or Ledger()
    looked_at = slice(first, first + len(names))
    wide = added.half_width(half)
    cells = [label]
    for size in (wide[looked_at] / half[looked_at], wide[looked_at]):
        worst = int(np.argmax(size))
        cells += [names[worst], *(significant(unit * values[looked_at][worst], 2) for values in (half, wide))]
    return f"| {' | '.join([*cells, declare(half, looked_at, added)])} |"


def declare(half: np.ndarray, looked_at: slice, undeclared: Ledger) -> str:
    """Return the errors to declare, the largest first, until the bound is at most a tenth wider."""
    effects, names = list(undeclared.rows), list[str]()
    while effects:
        ratio = Ledger(tuple(effects)).half_width(half)[looked_at] / half[looked_at]
        parameter = int(np.argmax(ratio))
        if ratio[parameter] <= 1 + ENOUGH:
            break
        largest = max(effects, key=lambda effect: effect.parameters[looked_at][parameter])
        effects.remove(largest)
        names.append(f"`{largest.error}`")
    return ", ".join(names) or "nothing"


def main() -> None:
    """Print the table."""
    folders = [Path(argument) for argument in sys.argv[1:]]
    jax.config.update("jax_enable_x64", True)
    print(
        "| experiment, method | component | interval, ± | bound, ± | widest | interval, ± | bound, ± "
        "| to declare, the largest first |"
    )
    print("|" + "---|" * 8)
    for name in EXAMPLES:
        for line in rows(name):
            print(line, flush=True)
    for folder in folders:
        print(*rows_of_throws(folder), sep="\n")
    print(row_of_poses())


if __name__ == "__main__":
    main()
