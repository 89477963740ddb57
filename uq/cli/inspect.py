"""``inertia inspect``: what is in a run, and what is suspicious about it."""

import argparse
import json
from typing import TYPE_CHECKING

from rig.exceptions import RigError

if TYPE_CHECKING:
    from rig.inspection.inspect import Inspection
    from uq.experiment.experiment import Experiment


NO_NOISE = (
    "the experiment declares no noise: `inertia noise STILL.mcap -o sources.toml` measures it from a recording at rest"
)


class MistakeError(Exception):
    """A mistake in the experiment or in how it declares the run, in one line."""


ERRORS = (RigError, MistakeError)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", nargs="+", help="recorded runs (MCAP)")
    parser.add_argument("--experiment", metavar="E.toml", help="meaning of the channels, mass, centre of gravity")
    parser.add_argument("--json", action="store_true", help="one line of JSON a run instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Inspect every run; 1 when something is suspicious."""
    from uq.inspection.inspect_run import inspect_run

    suspicious = False
    experiment = None if arguments.experiment is None else _load(arguments.experiment)
    for path in arguments.run:
        report = inspect_run(path) if experiment is None else _inspect_as_declared(path, experiment)
        print(json.dumps(report.to_dict()) if arguments.json else report)
        suspicious = suspicious or bool(report.findings)
    if experiment is not None and not arguments.json and not any(source.noise for source in experiment.sources):
        print(NO_NOISE)
    return 1 if suspicious else 0


def _load(name: str) -> "Experiment":
    """Read the experiment. Loads JAX, which plain ``inspect`` does without."""
    from uq.terminal import common

    common.start_jax()
    from uq.experiment.experiment import Experiment
    from uq.files.document import ExperimentError

    try:
        return Experiment.load(name)
    except ExperimentError as error:
        raise MistakeError(str(error)) from error


def _inspect_as_declared(path: str, experiment: "Experiment") -> "Inspection":
    from identify.signals.run import RunError
    from uq.files.document import ExperimentError
    from uq.inspection.inspect_run import inspect_run

    try:
        return inspect_run(path, experiment)
    except (RunError, ExperimentError) as error:
        raise MistakeError(str(error)) from error
