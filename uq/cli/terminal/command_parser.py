"""The parser of a command's arguments: how commands declare them, and a complaint in one line."""

import argparse
import contextlib
import sys
from typing import Any, NoReturn

from rig.exceptions import on_one_line, quoted

LONGEST = 150
"""Most characters of a complaint about an option that are shown as they are; it repeats whatever was typed."""


class CommandParser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line and exit status 2."""

    def value(self, name: str, metavar: str, text: str, **more: Any) -> None:
        """Declare an argument with a value, or with several.

        Args:
            name: of a positional, or of an option, with its dashes.
            metavar: what stands for the value in the help.
            text: of the help.
            more: as ``add_argument`` takes it.
        """
        self.add_argument(name, metavar=metavar, help=text, **more)

    def switch(self, name: str, text: str) -> None:
        """Declare an option without a value."""
        self.add_argument(name, action="store_true", help=text)

    def error(self, message: str) -> NoReturn:
        """End the program with the message in one line."""
        complain(f"{message if len(message) <= LONGEST else quoted(message)}; see '{self.prog} --help'")
        self.exit(2)


def complain(message: str) -> None:
    """Print an error in one line."""
    with contextlib.suppress(OSError):  # nobody hears it
        print(f"error: {on_one_line(message)}", file=sys.stderr, flush=True)
