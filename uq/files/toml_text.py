"""The content of an experiment file as TOML text: what ``tomllib`` reads of it is the same again."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

BARE = re.compile(r"[A-Za-z0-9_-]+")
"""A key that needs no quotes."""


def toml_text(content: Mapping[str, Any]) -> str:
    """Return nested tables, lists, strings, numbers, truth values and dates as TOML.

    Raises:
        ValueError: something that TOML does not hold.
    """
    text = "\n".join(_table(content, ())) + "\n"
    if tomllib.loads(text) != dict(content):
        raise ValueError("the content does not survive a round trip through TOML")
    return text


def _table(content: Mapping[str, Any], above: tuple[str, ...]) -> Iterator[str]:
    """Lines of a table: its plain keys, then the tables inside it."""
    inside = {key: value for key, value in content.items() if isinstance(value, Mapping) or _tables(value)}
    for key, value in content.items():
        if key not in inside:
            yield f"{_key(key)} = {toml_value(value)}"
    for key, value in inside.items():
        here = (*above, key)
        name = ".".join(map(_key, here))
        for head, table in (
            ((f"[{name}]", value),) if isinstance(value, Mapping) else ((f"[[{name}]]", t) for t in value)
        ):
            if table is not value or not table or any(not isinstance(item, Mapping) for item in table.values()):
                yield ""
                yield head
            yield from _table(table, here)


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def toml_value(value: Any) -> str:
    """Return a value as it stands behind its key, a table in braces.

    Raises:
        ValueError: TOML does not hold it.
    """
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return repr(value)
    if hasattr(value, "isoformat"):
        return value.isoformat()
    raise ValueError(f"{value!r} has no place in TOML")


def _key(key: str) -> str:
    return key if BARE.fullmatch(key) else _text(key)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
