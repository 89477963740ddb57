"""The JSON Schema of a TOML file from its declared tables, by which editors complete and check it."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from typing import Any, get_args, get_type_hints

import msgspec

from rig.toml_tables import TomlTable

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(table: type[TomlTable], *parts: type[TomlTable]) -> dict[str, Any]:
    """Return the JSON Schema of a file: types, words to choose from, units by example, and what each key means.

    Args:
        table: the file's declaration.
        parts: tables to which an annotation's schema refers, and bases whose keys are written once.
    """
    _, definitions = msgspec.json.schema_components((table, *parts), schema_hook=lambda _: {"type": "object"})
    classes = {part.__name__: part for root in (table, *parts) for part in _tables_in(root)}
    definitions = {name: schema for name, schema in definitions.items() if name in classes}  # others stand in no file
    for name, definition in definitions.items():
        definition.pop("title", None)
        definition["description"] = definition.get("description", "").replace("``", "")
        meanings = {key: text for base in reversed(classes[name].__mro__) for key, text in _meanings(base).items()}
        for key, value in definition.get("properties", {}).items():
            base = _declaring(key, classes[name])
            inherited = base is not classes[name] and base.__name__ in definitions
            reference = {"$ref": f"#/$defs/{base.__name__}/properties/{key}"}
            definition["properties"][key] = reference if inherited else _described(value, meanings.get(key, ""))
    shared: dict[str, Any] = {}
    plain = _plain(definitions, shared)
    return {"$schema": DIALECT, **plain.pop(table.__name__), "$defs": plain | dict(sorted(shared.items()))}


def _declaring(key: str, table: type) -> type:
    """The class, of a table and its bases, that declares a key; the table itself for the key of its tag."""
    return next((base for base in table.__mro__ if key in inspect.get_annotations(base)), table)


def _tables_in(hint: Any) -> Iterator[type[TomlTable]]:
    """The tables that a type is made of."""
    if isinstance(hint, type) and issubclass(hint, TomlTable):
        yield hint
        parts: Iterable[Any] = get_type_hints(hint, include_extras=True).values()
    else:
        parts = get_args(hint)
    for part in parts:
        yield from _tables_in(part)


def _meanings(table: type) -> dict[str, str]:
    """The docstrings below the fields of a class, by the fields' names."""
    if not issubclass(table, TomlTable) or table is TomlTable:
        return {}
    try:
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(table))).body
    except OSError:  # made by a function, which describes its fields by their annotations
        return {}
    body = tree.body if isinstance(tree, ast.ClassDef) else []
    return {
        field.target.id: re.sub(r"\s+", " ", doc.value.value).replace("``", "")
        for field, doc in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        and isinstance(doc, ast.Expr) and isinstance(doc.value, ast.Constant) and isinstance(doc.value.value, str)
    }  # fmt: skip


def _described(value: dict[str, Any], meaning: str) -> dict[str, Any]:
    """A key's schema with its meaning, how its unit is written, and a default that stands in a file as it does here."""
    default = value.pop("default", None)
    meaning = (
        meaning
        or value.get("description", "")
        or next((item["description"] for item in value.get("anyOf", ()) if "description" in item), "")
    )
    if isinstance(default, (str, bool, int)) and "written" not in value:
        value["default"] = default
    example = re.search(r"'examples': \['([^']+)'\]", str(value))
    with_unit = f'With its unit, such as "{example[1]}".' if example and "quantity" in str(value) else ""
    description = " ".join(text for text in (meaning, with_unit) if text)
    return {**value, "description": description} if description else value


def _plain(schema: Any, shared: dict[str, Any]) -> Any:
    """Return a schema without null, which TOML does not have, and with the written form of converted values.

    A schema with a title is written once, into ``shared`` by its title, and referred to.
    """
    if isinstance(schema, list):
        return [_plain(item, shared) for item in schema if item != {"type": "null"}]
    if not isinstance(schema, Mapping):
        return schema
    described = {key: schema[key] for key in ("description",) if key in schema}
    if "written" in schema:
        return _plain({**schema["written"], **described}, shared)
    if isinstance(schema.get("title"), str):  # not a key of this name
        name = re.sub(r"\W+", "_", schema["title"].replace("/", " per ").replace("%", "percent")).strip("_")
        rest = {key: value for key, value in schema.items() if key not in ("title", "description")}
        shared[name] = _plain(rest, shared)
        return {"$ref": f"#/$defs/{name}", **described}
    plain = {key: _plain(value, shared) for key, value in schema.items()}
    if "prefixItems" in plain and all(item == plain["prefixItems"][0] for item in plain["prefixItems"]):
        plain["items"] = plain.pop("prefixItems")[0]
    if len(plain.get("anyOf", ())) == 1:
        (only,) = plain.pop("anyOf")
        return {**only, **plain}
    return plain
