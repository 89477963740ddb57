"""``inertia import``: named columns of a table to a run of ours."""

import argparse

from identify.signals.run import RunError
from rig.exceptions import RigError
from uq.files.document import ExperimentError
from uq.recorded.import_table import Map, import_table

ERRORS = (ExperimentError, RunError, RigError)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("table", metavar="TABLE.csv", help="a table as text, one row a sample")
    parser.add_argument("--map", required=True, metavar="MAP.toml", help="the table's columns: units, signs, frames")
    parser.add_argument(
        "-o", "--output", metavar="RUN.mcap", required=True, help="the file to write; it must not exist"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    print(import_table(arguments.table, Map.load(arguments.map), arguments.output))
    return 0
