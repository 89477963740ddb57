"""``inertia paper``: the source's Table 2 and figures, beside its printed values."""

import argparse

from uq.barreto2016 import paper
from uq.commands._common import ERRORS, ProgressBar, finish, output_folder, start_jax, whole_number

__all__ = ["ERRORS", "configure", "run"]


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--trials", type=whole_number, default=10_000, help="number of trials (10000)")
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of every draw (0)")
    parser.add_argument(
        "--dtype", choices=("float64", "float32"), default="float64", help="precision of the draws (float64)"
    )
    parser.add_argument("--out", metavar="DIR", help="folder for result.json, report.html and the figures")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    with output_folder(arguments.out) as out:
        with ProgressBar() as progress:
            result = paper(trials=arguments.trials, seed=arguments.seed, dtype=arguments.dtype, progress=progress)
        finish(result, out)
    return 0
