"""``inertia inspect``: what is in a run, and what is suspicious about it."""

import argparse
import json
from collections.abc import Callable

from rig.exceptions import RigError
from rig.inspection.suspicions import Finding


class MistakeError(Exception):
    """A mistake in the experiment or in how it declares the run, in one line."""


ERRORS = (RigError, MistakeError)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", nargs="+", help="recorded runs (MCAP)")
    parser.add_argument("--experiment", metavar="E.toml", help="what the channels mean, mass, centre of gravity")
    parser.add_argument("--json", action="store_true", help="one line of JSON a run instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Inspect every run; 1 when something is suspicious."""
    from rig.inspection.inspect import inspect

    suspicious = False
    judge = None if arguments.experiment is None else _judge(arguments.experiment)
    for path in arguments.run:
        report = inspect(path, judge=judge)
        print(json.dumps(report.to_dict()) if arguments.json else report)
        suspicious = suspicious or bool(report.findings)
    return 1 if suspicious else 0


def _judge(name: str) -> Callable[[str], list[Finding]]:
    """Look at a run as its experiment declares it. Loads JAX, which plain ``inspect`` does without."""
    from uq.cli import common as _common

    _common.start_jax()
    from identify.signals.run import RunError
    from uq.experiment.experiment import Experiment
    from uq.files.document import ExperimentError
    from uq.recorded.load_run import load
    from uq.recorded.parts import cut
    from uq.recorded.suspected import suspected

    try:
        experiment = Experiment.load(name)
    except ExperimentError as error:
        raise MistakeError(str(error)) from error

    def judge(path: str) -> list[Finding]:
        try:
            return suspected(cut(load(path, experiment.recording, marks=False).run, None, ()), experiment)
        except RunError as error:
            raise MistakeError(str(error)) from error

    return judge
