"""Tables of a TOML file as declared types, or one line with key and cure.

A table is a subclass of :class:`TomlTable`; its fields are the keys, their types what may be written. Plain values and
the JSON Schema of the whole are msgspec's. The walk over the tables is ours: :func:`msgspec.convert` calls each entry
of a mapping ``[...]`` and those of an array by number, where our messages name them, and it converts no units.
"""

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec

from rig.exceptions import ECHO, listed, nearest, quoted, reason

T = TypeVar("T", bound="TomlTable")
LARGEST = 1_000_000
"""Largest whole number that a file may hold."""
LONGEST = 10_000
"""Most characters of a text."""
LARGEST_FILE = 2**22
"""Most bytes of a file: a short key takes 300 times its length in memory."""
DEEPEST = 16
"""Most parts of a dotted key; ``tomllib`` takes memory with the square of their number."""
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=80)]
"""Name of something in results, messages and files."""
_PART = r"""(?:[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+"""
_TOKENS = re.compile(
    rf"(?P<deep>{_PART}(?:\.[ \t]*+{_PART}){{{DEEPEST}}})"
    r'|#[^\n]*+|"""(?s:[^\\]|\\.)*?(?:"{3,5}|\Z)|'
    r"'''(?s:.)*?(?:'{3,5}|\Z)|"
    r'"(?:[^"\\\n]|\\.)*+"?|'
    r"'[^'\n]*+'?|[\w-]++"
)
"""A key of too many parts; comments and texts, which end with the line if they are not closed; single parts."""
NAMES = {str: "a string", int: "a whole number", bool: "true or false", float: "a finite number"}
COUNTS = {2: "two", 3: "three"}


class TomlError(ValueError):
    """A mistake in a TOML file, in one line: what, where, what to do."""


def parse_toml(data: bytes) -> dict[str, Any]:
    """Return the content of a TOML file.

    Raises:
        TomlError: it is no TOML in UTF-8, or too large; its keys, tables or lists lie too deep; a number has thousands
            of digits.
    """
    if len(data) > LARGEST_FILE:
        raise TomlError(f"over {LARGEST_FILE / 2**20:g} MiB")
    try:
        text = data.decode()
    except UnicodeDecodeError:
        raise TomlError("not a text file") from None
    if deep := next((token for token in _TOKENS.finditer(text) if token["deep"]), None):
        line = text.count("\n", 0, deep.start()) + 1
        raise TomlError(f"a key of more than {DEEPEST} parts (at line {line})")
    try:
        document = tomllib.loads(text)
        repr(document)  # in hexadecimal a number may have more digits than Python writes into a message
    except RecursionError:
        raise TomlError("tables or lists are nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        raise TomlError(reason(error)) from None
    except ValueError:  # Python's limit on digits
        raise TomlError("a number has thousands of digits") from None
    return document


class WrongKeyError(ValueError):
    """The complaint of a table's check about one of its keys, or about the table as a whole.

    Args:
        key: the key; "" for the table.
        advice: what to do about it; of the table, all that there is to say; "" where the problem says it.
        problem: what is wrong, to follow the key's path, such as "is singular"; else it is missing, or its value is.
    """

    def __init__(self, key: str, advice: str, problem: str | None = None):
        super().__init__(f"{key} {problem or 'is wrong'}: {advice}" if key else advice)
        self.key, self.advice, self.problem = key, advice, problem

    def line(self, where: str, raw: Mapping[str, Any]) -> str:
        """Return the message for a table that stands at ``where`` and holds ``raw``."""
        path = _path(where, self.key)
        if not self.key:
            return f"{where} {self.advice}".lstrip()
        if self.problem is None and self.key not in raw:
            return f"missing key {path}: {self.advice}"
        problem = self.problem or f"is {quoted(raw[self.key])}"
        return f"{path} {problem}: {self.advice}" if self.advice else f"{path} {problem}"


class TomlTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a TOML file: a field a key, its docstring what the key means.

    A check of several keys together stands in ``__post_init__`` and raises :class:`WrongKeyError`.
    """

    def to_dict(self) -> dict[str, Any]:
        """Return the values by their keys."""
        return msgspec.structs.asdict(self)


def written(read: Callable[[str, Any], Any], schema: Mapping[str, Any]) -> msgspec.Meta:
    """Return the annotation of a value that is written in another form.

    Args:
        read: what makes the value of the key's path and what is written there; raises TomlError, or ValueError with
            what is to follow the path.
        schema: the JSON Schema of what is written.
    """
    return msgspec.Meta(extra={"read": read}, extra_json_schema={"written": dict(schema)})


def read_table(where: str, raw: object, table: type[T]) -> T:
    """Return a table's values.

    Args:
        where: path of the table in its file, "" for the file itself.
        raw: what the file holds there.
        table: its declaration.

    Raises:
        TomlError: a key is missing or unknown, or a value is none that it may have.
    """
    if not isinstance(raw, Mapping):
        raise TomlError(f"{where} is {quoted(raw)}: write a table")
    types, values = _types(table), {}
    config = table.__struct_config__
    tag = (config.tag_field,) if config.tag_field else ()
    keys = (*table.__struct_encode_fields__, *tag)
    for field in msgspec.structs.fields(table):
        path = _path(where, field.encode_name)
        if field.encode_name in raw:
            values[field.name] = read_value(path, raw[field.encode_name], types[field.name])
        elif field.required:
            _refuse_unknown(where, raw, keys)  # first: a misspelt key is missing, too
            raise TomlError(f"missing key {path}: add it")
    _refuse_unknown(where, raw, keys)
    try:
        return table(**values)
    except WrongKeyError as mistake:
        raise TomlError(mistake.line(where, raw)) from None


@cache
def _types(table: type[TomlTable]) -> dict[str, Any]:
    return get_type_hints(table, include_extras=True)


def _path(where: str, key: str) -> str:
    return f"{where}.{key}" if where and key else where or key


def _refuse_unknown(where: str, raw: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    if unknown := sorted(set(raw) - set(keys)):
        name = unknown[0] if len(unknown[0]) <= ECHO and unknown[0].isprintable() else quoted(unknown[0])
        meant = nearest(unknown[0], keys)
        raise TomlError(f"unknown key {_path(where, name)}: {meant}the keys here are {listed(sorted(keys))}")


def read_value(path: str, raw: object, hint: Any) -> Any:
    """Return the value of a key, or of an item of it, of the type ``hint``; see :func:`read_table`."""
    for meta in getattr(hint, "__metadata__", ()):
        if meta.extra:
            return _written(path, raw, meta.extra["read"])
    if hint is Any:
        return raw
    plain = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    if get_origin(plain) in (Union, UnionType):
        return read_value(path, raw, _alternative(path, raw, plain))
    if isinstance(plain, type) and issubclass(plain, TomlTable):
        return read_table(path, raw, plain)
    if get_origin(plain) is tuple:
        return _items(path, raw, plain)
    if get_origin(plain) is Mapping:
        if not isinstance(raw, Mapping):
            raise TomlError(f"{path} is {quoted(raw)}: write a table")
        key_type, value_type = get_args(plain)
        if get_origin(key_type) is Literal:
            _refuse_unknown(path, raw, get_args(key_type))
        for key in raw:
            read_value(f"a name in {path}", key, Name)
        return {key: read_value(f"{path}.{key}", item, value_type) for key, item in raw.items()}
    return _plain(path, raw, hint, plain)


def _written(path: str, raw: object, read: Callable[[str, Any], Any]) -> Any:
    try:
        return read(path, raw)
    except TomlError:
        raise
    except ValueError as error:
        raise TomlError(f"{path} {error}") from None


def _alternative(path: str, raw: object, union: Any) -> Any:
    """The type among several that a value is to have: by its form; a table's by the key that tells them apart."""
    options = [option for option in get_args(union) if option is not type(None)]
    tables = _tables(union)
    lists = [option for option in options if get_origin(option) is tuple]
    others = [option for option in options if option not in (*tables, *lists)]
    fitting = (tables if isinstance(raw, Mapping) else lists if isinstance(raw, list) else others) or others or options
    return _tagged(path, raw, tables) if fitting is tables and len(tables) > 1 else fitting[0]


def _tagged(path: str, raw: Any, tables: list[type[TomlTable]]) -> type[TomlTable]:
    by_tag = {str(table.__struct_config__.tag): table for table in tables}
    key = str(tables[0].__struct_config__.tag_field)
    if key not in raw:
        raise TomlError(f"missing key {path}.{key}: add it")
    return by_tag[read_value(f"{path}.{key}", raw[key], Literal[tuple(by_tag)])]


def _items(path: str, raw: object, hint: Any) -> Any:
    """Any number of items (``tuple[X, ...]``) or as many as the tuple has; a table among them is called by its name."""
    types = get_args(hint)
    if types[-1] is Ellipsis:
        if not isinstance(raw, list):
            several = (
                f"is a table: write [[{path}]], one for each"
                if _tables(types[0])
                else f"is {quoted(raw)}: write a list"
            )
            raise TomlError(f"{path} {several}")
        return tuple(read_value(f"{path}[{item_label(i, item)}]", item, types[0]) for i, item in enumerate(raw))
    if not isinstance(raw, list) or len(raw) != len(types):
        raise TomlError(f"{path} is {quoted(raw)}: write {_count(types)}")
    return tuple(
        read_value(f"{path}[{i}]", item, item_type) for i, (item, item_type) in enumerate(zip(raw, types, strict=True))
    )


def _count(types: tuple[Any, ...]) -> str:
    if types[0] is str:
        return f"the names of {len(types)} columns"
    units = " with their units" if get_origin(types[0]) is Annotated else ""
    return f"{COUNTS.get(len(types), len(types))} values{units}{', one per axis' if len(types) == 3 else ''}"


def _tables(hint: Any) -> list[type[TomlTable]]:
    """The tables among the alternatives of a type."""
    options = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return [option for option in options if isinstance(option, type) and issubclass(option, TomlTable)]


def item_label(index: int, item: object) -> str:
    """Return what stands for one of several tables in a path: its name where that can be printed, else its number."""
    name = item.get("name") if isinstance(item, Mapping) else None
    return name if isinstance(name, str) and name.isprintable() and len(name) <= ECHO else str(index)


def _plain(path: str, raw: object, hint: Any, plain: Any) -> Any:
    """A string, a finite number, a truth value, one of several words."""
    if hint is int and isinstance(raw, int) and abs(raw) > LARGEST:
        raise TomlError(f"{path} is out of range: write a smaller number")
    try:
        value = msgspec.convert(raw, hint)
    except (msgspec.ValidationError, OverflowError):
        value = math.nan
    if isinstance(value, float) and not math.isfinite(value):
        raise TomlError(f"{path} is {quoted(raw)}: {_advice(hint, plain)}")
    if isinstance(value, str) and (len(value) > LONGEST or not _one_line(value, hint).isprintable()):
        raise TomlError(f"{path} is {quoted(raw)}: write a text without control characters, of {LONGEST:,} at most")
    return value


def _one_line(text: str, hint: Any) -> str:
    """A text without its line feeds and tabs, which no name may have."""
    return text if hint is Name else "".join(text.split())


def _advice(hint: Any, plain: Any) -> str:
    if get_origin(plain) is Literal:
        return f"choose one of {listed(get_args(plain))}"
    for meta in getattr(hint, "__metadata__", ()):
        if meta.max_length is not None:
            return f"write {meta.min_length} to {meta.max_length} characters, none of them a control character"
        if meta.ge is not None:
            return f"write a number from {meta.ge:g} to {meta.le:g}"
    return f"write {NAMES[plain]}"
