"""Both intervals of the examples' experiments, and what a user must declare to make them one.

``python -m benchmarks.studies.interval_widths``: each experiment of ``inertia examples`` that can be simulated, one run
of it, without the line ``undeclared = "none"``, by each method. The second interval rests on typical figures, so that
one run tells its width.
"""

import tempfile
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import jax
import numpy as np

from identify.results.identification_result import Identification
from identify.results.undeclared import Undeclared
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import significant
from uq.campaign.simulation import simulate
from uq.experiment.experiment import Experiment
from uq.files.mistakes import MISTAKES
from uq.identification.identify_files import identify_files

EXAMPLES = ("t1-10s", "designed", "many-errors", "laboratory", "robot")
METHODS = ("source", "gls", "joint")
ENOUGH = 0.1
"""Part by which the second interval may exceed the first for both to count as one."""


def rows(name: str) -> Iterator[str]:
    """Yield a line of the table for each method, of the component whose second interval is widest for its first."""
    with tempfile.TemporaryDirectory() as folder:
        for file in (files("uq") / "examples").iterdir():
            (Path(folder) / file.name).write_text(file.read_text("utf-8").replace('undeclared = "none"', ""), "utf-8")
        experiment, path = Experiment.load(Path(folder) / f"{name}.toml"), Path(folder) / "run.mcap"
        simulate(experiment, seed=1).write(path)
        for method in METHODS:
            try:
                result = identify_files([path], experiment, method=method)
            except MISTAKES as error:
                yield f"| {name}, {method} | {error} | | | |"
                continue
            first, second = (
                np.ptp(ends, axis=1) / 2 for ends in (result.interval95, result.interval95_with_undeclared)
            )
            worst = int(np.argmax(second / first))
            cells = [significant(GRAM_METRE * half[worst], 2) for half in (first, second)]
            yield f"| {name}, {method} | {COMPONENTS[worst]} | {' | '.join(cells)} | {declare(result)} |"


def declare(result: Identification) -> str:
    """Return the errors to declare, the largest first, until the second interval is at most a tenth wider."""
    half = result.coverage_factors * result.parameters.standard_uncertainty
    effects, names = list(result.undeclared.effects if result.undeclared else ()), list[str]()
    while effects:
        wide = Undeclared(tuple(effects)).half_width(half)[4:]
        component = int(np.argmax(wide / half[4:]))
        if wide[component] <= (1 + ENOUGH) * half[4 + component]:
            break
        largest = max(effects, key=lambda effect: effect.inertia[component])
        effects.remove(largest)
        names.append(f"`{largest.name}`")
    return ", ".join(names) or "nothing"


def main() -> None:
    """Print the table."""
    jax.config.update("jax_enable_x64", True)
    print("| experiment, method | component | first, ± g·m² | second, ± g·m² | to declare, the largest first |")
    print("|" + "---|" * 5)
    for name in EXAMPLES:
        for line in rows(name):
            print(line, flush=True)


if __name__ == "__main__":
    main()
