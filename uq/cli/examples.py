"""``inertia examples``: the experiments, rigs and bodies that the documentation uses, to run and to change."""

import argparse
from importlib.resources import files
from pathlib import Path

from rig.exceptions import RigError, quoted
from uq.cli.terminal.command_parser import CommandParser


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("names", "NAME", "examples to copy; without a name and without -o they are listed", nargs="*")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder to copy to (here); without a name: all examples")


def run(arguments: argparse.Namespace) -> int:
    """List the examples, or copy some with the files that they name; a copy finds the schemas that are installed."""
    schemas = Path(str(files("uq") / "schemas")).as_uri()
    texts = {
        file.name: file.read_text("utf-8").replace("#:schema ../schemas", f"#:schema {schemas}")
        for file in (files("uq") / "examples").iterdir()
    }
    names = sorted(name.removesuffix(".toml") for name in texts if name.endswith(".toml"))
    if unknown := set(arguments.names) - set(names):
        raise RigError(f"unknown example {quoted(min(unknown))}: choose of {', '.join(names)}")
    if not arguments.names and arguments.output is None:
        for name in names:
            comment = texts[f"{name}.toml"].splitlines()[1].removeprefix("# ")
            print(f"{name:<{max(map(len, names))}}  {comment.partition(':')[0].partition('. ')[0].rstrip('.')}")
        return 0
    chosen = [f"{name}.toml" for name in arguments.names or names]
    chosen += [name for name in texts if name not in chosen and any(name in texts[file] for file in chosen)]
    folder = Path(arguments.output or ".")
    for path in (folder / name for name in chosen):
        if path.exists() and path.read_text("utf-8", "replace") != texts[path.name]:
            raise RigError(f"{path} is there and differs from the example: rename it, or give another folder with -o")
    folder.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        (folder / name).write_text(texts[name], "utf-8")
        print(folder / name)
    return 0
