"""``python -m benchmarks.answers``: processor time of whole commands, in units of JAX's own start.

The reference is ``python -c "import jax, jax.numpy as n; n.ones(3) + 1"``. Commands and reference alternate; user time
of the process and its children, median of the rounds. Compiled code is in its folder already (warm), or the folder is
new each time (cold); Python's bytecode is there always, as after an installation. ``--tree DIR`` measures another
version beside this one: its own code, the same interpreter.
"""

import argparse
import compileall
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

from identify.display.text_tables import text_table  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.monte_carlo.campaign.simulation import simulate  # noqa: E402

HERE = Path(__file__).parents[1]
REFERENCE = ["-c", "import jax, jax.numpy as n; n.ones(3) + 1"]
BEGIN = """
try:
    from uq.cli.main import main
except ModuleNotFoundError:  # version 0.2.0
    from uq.cli import main
raise SystemExit(main())
"""
RUNS = 10
"""Runs of 30 s."""


def recordings(folder: Path) -> None:
    """Write the runs that are identified: T1 of the preset, and runs of 30 s with other draws."""
    ten_seconds = (HERE / "uq" / "examples" / "t1-10s.toml").read_text("utf-8")
    brief = folder / "brief.toml"
    brief.write_text(
        ten_seconds.replace('duration = "10 s"', 'duration = "30 s"').replace("../../uq", str(HERE / "uq")), "utf-8"
    )
    simulate(Experiment.load("barreto2016"), "T1").write(folder / "T1.mcap")
    for trial in range(RUNS):
        simulate(Experiment.load(brief), "T1", trial=trial).write(folder / f"brief{trial}.mcap")


def commands(folder: Path) -> dict[str, list[str]]:
    """Return the commands by name; ``--out`` is a folder of its own."""
    t1, brief = str(folder / "T1.mcap"), [str(folder / f"brief{k}.mcap") for k in range(RUNS)]
    preset, short = ["--experiment", "barreto2016"], ["--experiment", str(folder / "brief.toml")]
    many = str(HERE / "uq" / "examples" / "many-errors.toml")
    return {
        "inspect T1": ["inspect", t1],
        "identify T1": ["identify", t1, *preset],
        "identify T1 --method gls": ["identify", t1, *preset, "--method", "gls"],
        "identify T1 --method joint": ["identify", t1, *preset, "--method", "joint"],
        f"identify {RUNS} runs of 30 s": ["identify", *brief, *short],
        "montecarlo barreto2016": ["montecarlo", "barreto2016"],
        "montecarlo barreto2016 --out D": ["montecarlo", "barreto2016", "--out", str(folder / "campaign")],
        "montecarlo barreto2016 --law": ["montecarlo", "barreto2016", "--law"],
        "montecarlo many-errors.toml": ["montecarlo", many],
        "paper --out D": ["paper", "--out", str(folder / "paper")],
    }


def user_seconds(arguments: Sequence[str], tree: Path, cache: Path) -> float:
    """Return the user time of a Python process with the packages of a tree."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "INERTIA_CACHE": str(cache)}
    process = subprocess.Popen(
        [sys.executable, *arguments], cwd=tree, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    messages = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"{' '.join(arguments)}: {messages.decode().strip()}")
    return usage.ru_utime


def measure(trees: Sequence[Path], rounds: int, word: str, *, cold: bool) -> list[list[str]]:
    """Return the table's rows: a command that holds a word; by tree its time over the reference's, and its seconds."""
    for tree, package in product(trees, ("identify", "rig", "uq")):
        compileall.compile_dir(tree / package, quiet=1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recordings(folder)
        chosen = {what: arguments for what, arguments in commands(folder).items() if word in what}
        taken: dict[tuple[str, Path], list[float]] = {}
        reference = []
        for number in range(rounds + (not cold)):
            for what, arguments in chosen.items():
                reference.append(user_seconds(REFERENCE, HERE, folder / "reference"))
                for k, tree in enumerate(trees):
                    cache = folder / (f"cold{number}{k}{len(reference)}" if cold else f"cache{k}")
                    seconds = user_seconds(["-c", BEGIN, *arguments], tree, cache)
                    if cold or number:  # the first round compiles
                        taken.setdefault((what, tree), []).append(seconds)
    unit = statistics.median(reference)
    rows = [["import jax and one operation", *["1", f"{unit:.2f}"] * len(trees)]]
    for what in chosen:
        middle = [statistics.median(taken[what, tree]) for tree in trees]
        rows.append([what, *(text for seconds in middle for text in (f"{seconds / unit:.1f}", f"{seconds:.2f}"))])
    return rows


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.answers", description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="alternations (5)")
    parser.add_argument("--cold", action="store_true", help="with an empty folder of compiled code")
    parser.add_argument("--tree", type=Path, nargs="*", default=[], help="checkouts of other versions")
    parser.add_argument("--only", default="", metavar="WORD", help="commands that hold this word")
    options = parser.parse_args()
    trees = [HERE, *(tree.resolve() for tree in options.tree)]
    head = ["user time", *(text for tree in trees for text in (f"times ({tree.name})", "s"))]
    print(text_table(head, measure(trees, options.rounds, options.only, cold=options.cold)))


if __name__ == "__main__":
    main()
