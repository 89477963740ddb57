"""What a sweep costs: ``python -m benchmarks.sweeps``, twenty values of the moment's noise, beside other ways.

Of T1 of the preset and of ``many-errors``: :func:`uq.sweep`, a loop of :func:`uq.montecarlo` in one process, and one
command a value. User seconds of the processes; warm, compiled code is in its folder already; cold, the folder is new.
Then whether sweep and loop have the same errors, bit for bit, and the largest difference of their 3σ if not.
"""

import argparse
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

from benchmarks.answers import BEGIN, HERE, user_seconds  # noqa: E402
from identify.display.text_tables import text_table  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.files.compilation_cache import keep_compiled  # noqa: E402
from uq.monte_carlo.campaign.campaign import montecarlo  # noqa: E402
from uq.monte_carlo.campaign.sweep import sweep, with_value  # noqa: E402

CASES = {
    "T1 of the preset": ("barreto2016", "T1", "source.M_precision.sigma"),
    "many-errors": (str(HERE / "uq" / "examples" / "many-errors.toml"), "T1", "source.M_noise.sigma"),
}
VALUES = [f"{value:.4g} N*m" for value in np.linspace(0.02, 0.4, 20)]


def swept(experiment: Experiment, trajectory: str, key: str, values: Sequence[str], trials: int) -> np.ndarray:
    """Return the errors of every value, (values, trials, estimators, cases, 6), by one call of ``sweep``."""
    result = sweep(experiment, {key: values}, trials=trials, trajectories=trajectory)
    return np.array([campaign.errors[trajectory] for campaign in result.campaigns.values()])


def looped(experiment: Experiment, trajectory: str, key: str, values: Sequence[str], trials: int) -> np.ndarray:
    """Return the same by a call of ``montecarlo`` for each value."""
    changed = [with_value(experiment, key, value) for value in values]
    return np.array([montecarlo(x, trials=trials, trajectories=trajectory).errors[trajectory] for x in changed])


WAYS: Mapping[str, Callable[..., np.ndarray]] = {"sweep": swept, "loop": looped}


def seconds(way: str, case: str, options: argparse.Namespace, cache: Path, out: Path) -> float:
    """Return the user seconds of a process that runs one way and writes its errors."""
    command = ["-m", "benchmarks.sweeps", "--way", way, "--case", case, "--out", str(out)]
    return user_seconds([*command, "--trials", str(options.trials), "--values", str(options.values)], HERE, cache)


def row(case: str, options: argparse.Namespace, folder: Path) -> list[str]:
    """Return the figures of one experiment."""
    file, trajectory, _ = CASES[case]
    out = {way: folder / f"{way}.npy" for way in WAYS}
    cold = {way: seconds(way, case, options, Path(tempfile.mkdtemp(dir=folder)), out[way]) for way in WAYS}
    cache = Path(tempfile.mkdtemp(dir=folder))
    seconds("loop", case, options, cache, out["loop"])  # compiles
    warm = {way: min(seconds(way, case, options, cache, out[way]) for _ in range(options.rounds)) for way in WAYS}
    command = ["-c", BEGIN, "montecarlo", file, "--trials", str(options.trials), "--trajectory", trajectory]
    user_seconds(command, HERE, cache)
    single_command = min(user_seconds(command, HERE, cache) for _ in range(options.rounds))
    errors = [np.load(path) for path in out.values()]
    spreads = [x.std(axis=1) for x in errors]
    apart = "same bits" if np.array_equal(*errors) else f"{np.nanmax(np.abs(spreads[0] / spreads[1] - 1)):.1e}"
    commands = options.values * single_command
    figures = [cold["sweep"], cold["loop"], warm["sweep"], warm["loop"], commands, commands / warm["sweep"]]
    return [case, *(f"{figure:.1f}" for figure in figures), apart]


def main() -> None:
    """Print the table, or run one way in this process."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=10_000)
    parser.add_argument("--values", type=int, default=len(VALUES))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--only", choices=CASES, nargs="*", default=list(CASES))
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--case", choices=CASES, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.way:
        keep_compiled()
        file, trajectory, key = CASES[options.case]
        values = VALUES[: options.values]
        np.save(options.out, WAYS[options.way](Experiment.load(file), trajectory, key, values, options.trials))
        return
    with tempfile.TemporaryDirectory() as folder:
        rows = [row(case, options, Path(folder)) for case in options.only]
    head = [
        "",
        "sweep, cold, s",
        "loop, cold",
        "sweep, warm",
        "loop, warm",
        "commands, warm",
        "ratio",
        "sweep and loop",
    ]
    print(text_table(head, rows))


if __name__ == "__main__":
    main()
