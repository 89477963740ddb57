"""Tables of what went into a result: its files, the declared error sources, inferred values of a preset."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from importlib import resources
from typing import Any

from identify.display.text_tables import Table
from uq.experiment.experiment import PRESETS
from uq.experiment.experiment_tables import SOURCE_HEAD, size_of


def input_table(provenance: Mapping[str, Any]) -> Table:
    """Return the table of every file that went into a result, with its SHA-256, wherever its provenance names it."""
    rows = list(dict.fromkeys(_named_files(provenance)))
    return Table("Inputs", ["file", "SHA-256"], rows, wrap=True)


def _named_files(content: object) -> Iterator[tuple[str, str]]:
    if isinstance(content, Mapping):
        if isinstance(content.get("file"), str) and isinstance(content.get("sha256"), str):
            yield content["file"], content["sha256"]
        content = list(content.values())
    if isinstance(content, (list, tuple)):
        for item in content:
            yield from _named_files(item)


def source_tables(provenance: Mapping[str, Any]) -> list[Table]:
    """Return the tables of error sources, with their references, and of inferred values."""
    document = provenance.get("experiment") or {}
    rows = [
        [s["name"], s["target"], s["kind"], s["group"], size_of(s), s.get("reference", "not given")]
        for s in document.get("source", [])
    ]
    tables = [Table("Error sources", [*SOURCE_HEAD, "reference"], rows)] if rows else []
    if guesses := inferred(document):
        note = "Not stated by the paper; the values that reproduce its Table 2."
        tables.append(Table("Inferred values", ["key", "value", "reason"], guesses, note))
    return tables


def inferred(document: Mapping[str, Any]) -> list[list[str]]:
    """Return key, value and reason of the values that a preset's file marks INFERRED; none for any other document."""
    for name in PRESETS:
        text = resources.files("uq").joinpath("presets", f"{name}.toml").read_text("utf-8")
        if tomllib.loads(text) == document:
            return _marked(text)
    return []


def _marked(text: str) -> list[list[str]]:
    rows, where = [], ""
    for line in text.splitlines():
        if header := re.match(r"\[+([^\]]+)\]+", line):
            where = header[1]
        elif mark := re.match(r"(\w+) *= *(.*?) *# INFERRED:? *(.*)", line):
            rows.append([f"{where}.{mark[1]}", mark[2].replace('"', "").strip("[]"), mark[3]])
    return rows
