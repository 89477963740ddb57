"""Protobuf messages as trees of named fields, by the optional package mcap-protobuf-support."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from mcap.records import Schema

from rig.exceptions import RigError, listed


class Fields(Mapping[str, Any]):
    """A protobuf message's fields by name; what the message leaves out is zero or empty, as proto3 has it."""

    def __init__(self, message: Any) -> None:
        self._message = message

    def __getitem__(self, name: str) -> Any:
        if name not in self._message.DESCRIPTOR.fields_by_name:
            raise KeyError(name)
        value = getattr(self._message, name)
        if hasattr(value, "DESCRIPTOR"):
            return Fields(value)
        return value if isinstance(value, int | float | str | bytes) else list(value)

    def __iter__(self) -> Iterator[str]:
        return iter(self._message.DESCRIPTOR.fields_by_name)

    def __len__(self) -> int:
        return len(self._message.DESCRIPTOR.fields)


@lru_cache(maxsize=64)
def decoder(descriptors: bytes, name: str) -> Callable[[bytes], Mapping[str, Any]]:
    """A function from bytes to the fields of a message type, which raises ``ValueError`` when the bytes are none.

    Args:
        descriptors: a serialised google.protobuf.FileDescriptorSet.
        name: full name of the message type.

    Raises:
        ValueError: the descriptors do not define it.
        RigError: the package is not installed.
    """
    try:
        from google.protobuf.message import DecodeError
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError:
        raise RigError("its messages are in protobuf: `pip install inertia-uq[bags]` reads them") from None
    try:
        decode: Any = DecoderFactory().decoder_for("protobuf", Schema(1, descriptors, "protobuf", name))
    except Exception as error:  # of mcap, protobuf and its pool of descriptors, whichever meets the mistake
        raise ValueError(f"its schema does not define {listed([name])}") from error

    def fields(data: bytes) -> Mapping[str, Any]:
        try:
            return Fields(decode(data))
        except DecodeError as error:
            raise ValueError(f"a message is no {listed([name])}") from error

    return fields
