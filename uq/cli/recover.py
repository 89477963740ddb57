"""``inertia recover``: every intact message of a cut or damaged file."""

import argparse

from rig.exceptions import on_one_line
from uq.cli.terminal.command_parser import CommandParser


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("broken", help="the cut or damaged MCAP file; it is only read")
    parser.add_argument("-o", "--output", required=True, help="the new file")


def run(arguments: argparse.Namespace) -> int:
    """Recover, and say what was saved and what was lost."""
    from rig.mcap.recover import recover

    result = recover(arguments.broken, arguments.output)
    print(on_one_line(f"{arguments.output}: {result}"))
    return 0 if result.intact else 1
