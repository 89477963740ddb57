"""The pages that the code itself tells: commands, keys of files, public names, notebooks."""

import argparse
import importlib
import inspect
import json
import keyword
import re
import textwrap
from importlib.resources import files
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config
from sphinx.ext.napoleon.docstring import GoogleDocstring

from uq.cli import main
from uq.cli.schema import file_schema
from uq.cli.terminal.command_parser import CommandParser

FILES = {
    "experiment": "an experiment file",
    "rig": "a rig file",
    "map": "a map of columns",
    "body": "a reference body",
    "jobs": "a file of jobs",
    "result": "result.json and centre.json",
}


def commands() -> str:
    """Every command with its options, from its parser."""
    lines = ["# Commands", "", "*Which commands and options are there?*", ""]
    for name, summary in main.COMMANDS.items():
        module = importlib.import_module(f"uq.cli.{name}{'_' * keyword.iskeyword(name)}")
        parser = CommandParser(prog=f"inertia {name}", description=summary)
        module.configure(parser)
        usage = " ".join(parser.format_usage().removeprefix("usage: ").split())
        end = "" if summary.endswith("?") else "."
        lines += [f"## inertia {name}", "", f"{summary[0].upper()}{summary[1:]}{end}", ""]
        lines += ["```text", *textwrap.wrap(usage, 80, subsequent_indent="    ", break_on_hyphens=False), "```", ""]
        for action in parser._actions:
            if not isinstance(action, argparse._HelpAction):
                lines += [f"`{_invocation(action)}`", f": {_escaped(_help(parser, action))}", ""]
    return "\n".join(lines)


def _invocation(action: argparse.Action) -> str:
    name = action.metavar or ("" if action.nargs == 0 else (action.dest or "").upper())
    name = name if isinstance(name, str) else " ".join(name)
    return ", ".join(f"{option} {name}".strip() for option in action.option_strings) or name.lower()


def _help(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    choices = f"one of {', '.join(map(str, action.choices))}" if action.choices else ""
    text = parser._get_formatter()._expand_help(action) if action.help else ""
    return "; ".join(filter(None, (text, choices))).replace("--", "\\-\\-") or "–"


def keys(which: str) -> str:
    """Every key of a TOML file with its type, its unit and what it is for, from the schema."""
    content = file_schema(which)
    definitions = content.get("$defs", {})
    lines = [
        f"# Keys of {FILES[which]}",
        "",
        "*Which keys are there?*",
        "",
        f"The JSON Schema: `inertia schema {which}`.",
        "",
    ]
    tables = {"": content, **definitions}
    for name, table in tables.items():
        properties = table.get("properties", {})
        if not properties:
            continue
        if name:
            lines += [f"## {name.removesuffix('Table')}", "", _escaped(table.get("description", "")), ""]
        lines += ["| key | value | what it is |", "|---|---|---|"]
        for key, value in properties.items():
            required = key in table.get("required", [])
            needed = "" if required == (which == "result") else " **Required.**" if required else " May be missing."
            default = f" Default: `{json.dumps(value['default'])}`." if "default" in value else ""
            meaning = _escaped(
                re.sub(r" ?With its unit, such as .*?\"\.", "", value.get("description", ""))
            )  # see _type
            cells = (f"`{key}`", _type(value, definitions), meaning + needed + default)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def _type(value: dict[str, Any], definitions: dict[str, Any]) -> str:
    """What a key's value may be, in words."""
    if "$ref" in value:
        target: Any = definitions
        *_, name = path = value["$ref"].removeprefix("#/$defs/").split("/")
        for step in path:
            target = target[step]
        if "properties" in target:
            return f"table {name.removesuffix('Table')}"
        return name if name == "rotation" else _type(target, definitions)
    if len(value.get("anyOf", ())) > 5:
        return "table, one of those below named after what errs and how"
    if "anyOf" in value:
        choices = (_type(choice, definitions) for choice in value["anyOf"] if choice.get("type") != "null")
        return " or ".join(dict.fromkeys(choices))
    if "enum" in value:
        return ", ".join(f"`{choice}`" for choice in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    if "examples" in value:
        return f'text such as `"{value["examples"][0]}"`'
    kind = value.get("type", "anything")
    if kind == "array":
        count = value.get("minItems", "") if value.get("minItems") == value.get("maxItems") else ""
        return f"list of {count}: {_type(value.get('items', {}), definitions)}".replace(" :", "")
    return kind if isinstance(kind, str) else " or ".join(kind)


def stable_names(package: str) -> list[str]:
    """The names of a package that stay, from its stub, without the aliases of the version before."""
    stub = (Path(str(files(package))) / "__init__.pyi").read_text("utf-8").partition("# Until ")[0]
    return sorted(re.findall(r"import (\w+)", stub))


def names(package: str) -> str:
    """Every name of a package that stays, from its docstring."""
    door = importlib.import_module(package)
    lines = [
        f"# Names of `{package}`",
        "",
        "*What does the package offer?*",
        "",
        *_directive(f"automodule:: {package}\n   :no-members:"),
    ]
    for name in stable_names(package):
        what = getattr(door, name)
        directive = "autoclass" if inspect.isclass(what) else "autofunction" if callable(what) else "autodata"
        lines += [f"## {name}", "", *_directive(f"{directive}:: {package}.{name}")]
    return "\n".join(lines)


def _directive(text: str) -> list[str]:
    return ["```{eval-rst}", f".. {text}", "```", ""]


def _escaped(text: str) -> str:
    pieces = " ".join(text.split()).replace("``", "`").split("`")
    for k in range(0, len(pieces), 2):  # the others stand in code, as they are
        pieces[k] = pieces[k].replace("<", "\\<").replace("[", "\\[").replace("*", "\\*")
    return "`".join(pieces)


def write(app: Sphinx) -> None:
    """Write the pages into the folder of the sources."""
    here = Path(app.srcdir)
    made = here / "generated"
    made.mkdir(exist_ok=True)
    pages = {"commands": commands(), **{f"{which}-file": keys(which) for which in FILES}}
    pages |= {f"names-{package}": names(package) for package in ("identify", "uq", "rig")}
    for name in ("CHANGELOG", "CONTRIBUTING", "SECURITY"):
        pages[name] = (here.parent / f"{name}.md").read_text("utf-8").replace("](docs/", "](../")
    for name, text in pages.items():
        path = made / f"{name}.md"
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    for notebook in sorted((here.parent / "notebooks").glob("*.ipynb")):
        (made / notebook.name).write_text(notebook.read_text("utf-8").replace("](../docs/", "](../"), "utf-8")


def links(app: Sphinx, page: str, content: list[str]) -> None:
    """Lead links to notebooks and to the repository's first pages to their copies."""
    content[0] = re.sub(r"\]\((?:\.\./)+(?:notebooks/)?(\w+\.ipynb|[A-Z]+\.md)\)", r"](/generated/\1)", content[0])


def sections(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Turn Google's sections of a docstring into fields. An attribute's is a sentence, in which a colon is a colon."""
    if what not in ("attribute", "data", "property"):
        style = Config(napoleon_numpy_docstring=False)
        lines[:] = GoogleDocstring(lines, style, app, what, name, thing, options).lines()


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.connect("builder-inited", write)
    app.connect("source-read", links)
    app.connect("autodoc-process-docstring", sections)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
