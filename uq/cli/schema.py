"""``inertia schema``: the JSON Schema of a TOML file, by which editors complete and check it; that of result files.

What it prints is shipped. ``python -m uq.cli.schema`` ships the schemas of TOML files anew, made of their tables.
"""

import argparse
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from uq.cli.terminal.command_parser import CommandParser

FILES = ("experiment", "rig", "map", "body", "jobs")
RESULT = "result"


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "file", nargs="?", choices=(*FILES, RESULT), default=FILES[0], help="kind of file (default: %(default)s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the schema as it is shipped, which needs no JAX."""
    print(_shipped(arguments.file), end="")
    return 0


def _shipped(file: str) -> str:
    return (files("uq") / "schemas" / f"{file}.json").read_text("utf-8")


def file_schema(file: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file: one of ``FILES``, made of its tables, or ``RESULT``, as shipped."""
    if file == RESULT:
        return json.loads(_shipped(file))
    from rig.record.rig_file import RigFile
    from rig.toml_tables import TomlTable
    from uq.bodies.reference import BodyFile
    from uq.experiment.experiment_file import ExperimentFile
    from uq.experiment.platform_table import Ring
    from uq.files.json_schema import json_schema
    from uq.jobs.jobs_file import JobsFile
    from uq.runs.tables.table_map import Map
    from uq.sources.source import KINDS
    from uq.sources.source_table import DrawTable, SourceTable, source_table

    if file != "experiment":
        tables: dict[str, type[TomlTable]] = {"rig": RigFile, "map": Map, "body": BodyFile, "jobs": JobsFile}
        return json_schema(tables[file])
    sources = [source_table(target, kind) for target, kind in sorted(KINDS)]
    schema = json_schema(ExperimentFile, Ring, SourceTable, DrawTable, *sources)
    schema["properties"]["source"]["items"] = {"anyOf": [{"$ref": f"#/$defs/{source.__name__}"} for source in sources]}
    return schema


def shipped_text(file: str) -> str:
    """Return the schema of a kind of TOML file as it is to be shipped."""
    return json.dumps(file_schema(file), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for name in FILES:
        Path(str(files("uq") / "schemas" / f"{name}.json")).write_text(shipped_text(name), "utf-8")
