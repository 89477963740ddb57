"""Protobuf messages to trees of named fields, by the descriptor that an MCAP schema carries.

The wire format and the descriptor's own fields are those of https://protobuf.dev/programming-guides/encoding and
``google/protobuf/descriptor.proto``. Fields that a message leaves out have their default, zero, as proto3 has it.
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
DEEPEST = 16
"""Messages inside one another, beyond which a schema is refused."""
FIXED = {1: "<d", 2: "<f", 6: "<Q", 7: "<I", 15: "<i", 16: "<q"}
"""Field types of fixed size: double, float, fixed64, fixed32, sfixed32, sfixed64."""
STRING, MESSAGE, DATA = 9, 11, 12
ZIGZAG = (17, 18)
SIGNED = (3, 5, 14)
REPEATED = 3


@dataclass(frozen=True)
class FieldType:
    """One field of a message type."""

    name: str
    kind: int
    repeated: bool
    type_name: str


Types = Mapping[str, Mapping[int, FieldType]]


def wire(data: bytes) -> Iterator[tuple[int, int, Any]]:
    """Field number, wire type and value of each field of a message. Raises ``ValueError`` when the bytes are none."""
    at, value = 0, cast(Any, None)
    while at < len(data):
        key, at = _varint(data, at)
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            value, at = _varint(data, at)
        elif kind in (FIXED64, FIXED32, BYTES):
            length, at = _varint(data, at) if kind == BYTES else (8 if kind == FIXED64 else 4, at)
            value, at = data[at : at + length], at + length
        else:
            raise ValueError(f"a message has a field of wire type {kind}")
        if at > len(data):
            raise ValueError("a message ends early")
        yield number, kind, value


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            raise ValueError("a message ends early")
        byte, at = data[at], at + 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & (2**64 - 1), at
    raise ValueError("a message holds a number of more than 64 bits")


@lru_cache(maxsize=64)
def decoder(descriptors: bytes, name: str) -> Callable[[bytes], Mapping[str, Any]]:
    """A function from bytes to the tree of a message type.

    Args:
        descriptors: a serialised google.protobuf.FileDescriptorSet.
        name: full name of the message type.

    Raises:
        ValueError: the descriptors do not define it.
    """
    types: dict[str, dict[int, FieldType]] = {}
    for number, kind, file in wire(descriptors):
        if (number, kind) == (1, BYTES):
            parts = [(n, v) for n, k, v in wire(file) if k == BYTES]
            package = next((v.decode() for n, v in parts if n == 2), "")
            for message in (v for n, v in parts if n == 4):
                _define(types, message, f".{package}" if package else "", 0)
    if f".{name}" not in types:
        raise ValueError(f"its schema does not define {name}")
    return lambda data: _tree(types, f".{name}", data, 0)


def _define(types: dict[str, dict[int, FieldType]], descriptor: bytes, outer: str, depth: int) -> None:
    """Enter a DescriptorProto and those inside it."""
    if depth > DEEPEST:
        raise ValueError("its schema nests too deeply")
    parts = [(n, v) for n, k, v in wire(descriptor) if k == BYTES]
    full = f"{outer}.{next(v.decode() for n, v in parts if n == 1)}"
    types[full] = dict(_field(v) for n, v in parts if n == 2)
    for inner in (v for n, v in parts if n == 3):
        _define(types, inner, full, depth + 1)


def _field(descriptor: bytes) -> tuple[int, FieldType]:
    """Number and meaning of a FieldDescriptorProto."""
    facts = {number: value for number, _, value in wire(descriptor)}
    return facts[3], FieldType(facts[1].decode(), facts.get(5, 0), facts.get(4) == REPEATED, facts.get(6, b"").decode())


def _tree(types: Types, name: str, data: bytes, depth: int) -> dict[str, Any]:
    if depth > DEEPEST or name not in types:
        raise ValueError(f"its schema does not define {name.lstrip('.')}")
    fields = types[name]
    tree: dict[str, Any] = {f.name: [] for f in fields.values() if f.repeated}
    for number, kind, value in wire(data):
        field = fields.get(number)
        if field is None:
            continue
        for item in _items(types, field, kind, value, depth):
            if field.repeated:
                tree[field.name].append(item)
            else:
                tree[field.name] = item
    for field in fields.values():
        if field.name not in tree and depth < DEEPEST:
            tree[field.name] = _tree(types, field.type_name, b"", depth + 1) if field.kind == MESSAGE else _zero(field)
    return tree


def _zero(field: FieldType) -> Any:
    return {STRING: "", DATA: b"", 1: 0.0, 2: 0.0}.get(field.kind, 0)


def _items(types: Types, field: FieldType, kind: int, value: Any, depth: int) -> Iterator[Any]:
    """The values of one occurrence of a field: several where they are packed."""
    if field.kind == MESSAGE:
        yield _tree(types, field.type_name, value, depth + 1)
    elif field.kind in (STRING, DATA):
        yield value.decode() if field.kind == STRING else value
    elif field.kind in FIXED:
        form = FIXED[field.kind]
        if kind == VARINT or len(value) % struct.calcsize(form):
            raise ValueError(f"its field {field.name} is not of its schema's type")
        yield from (item for (item,) in struct.iter_unpack(form, value))
    elif kind == BYTES:
        at = 0
        while at < len(value):
            item, at = _varint(value, at)
            yield _number(field, item)
    else:
        yield _number(field, value)


def _number(field: FieldType, value: int) -> int:
    """A varint as its type has it."""
    if field.kind in ZIGZAG:
        return (value >> 1) ^ -(value & 1)
    return value - 2**64 if field.kind in SIGNED and value >= 2**63 else value
