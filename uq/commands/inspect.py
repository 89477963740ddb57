"""``inertia inspect``: what is in a run, and what is suspicious about it."""

import argparse
import json

from rig.errors import RigError

ERRORS = (RigError,)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", nargs="+", help="recorded runs (MCAP)")
    parser.add_argument("--json", action="store_true", help="one line of JSON a run instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Inspect every run; 1 when something is suspicious."""
    from rig.inspection import inspect

    suspicious = False
    for path in arguments.run:
        report = inspect(path)
        print(json.dumps(report.to_dict()) if arguments.json else report)
        suspicious = suspicious or bool(report.findings)
    return 1 if suspicious else 0
