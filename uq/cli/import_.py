"""``inertia import``: named columns of a table to a run of ours; without a map, a map of them is proposed."""

import argparse
from pathlib import Path

from uq.cli.terminal.command_parser import CommandParser
from uq.runs.tables.import_table import import_table
from uq.runs.tables.proposed_map import propose
from uq.runs.tables.table_map import Map


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("tables", "TABLE", "a table as text, one row per sample; or two, joined by their times", nargs="+")
    parser.value("--map", "MAP.toml", "the columns: units, signs, frames; without it one is proposed, to be checked")
    parser.add_argument(
        "-o", "--output", metavar="RUN.mcap", required=True, help="the file to write; it must not exist"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command; status 1: a map is proposed, and no run was written."""
    if arguments.map is None:
        print(propose(arguments.tables, Path(arguments.output)))
        return 1
    print(import_table(arguments.tables, Map.load(arguments.map), arguments.output))
    return 0
