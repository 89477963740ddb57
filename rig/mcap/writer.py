"""The MCAP writer with our settings: profile ros2, a checksum over everything, a small index, full definitions."""

import tempfile
from collections.abc import Iterator
from typing import IO, Literal, Protocol, cast, runtime_checkable

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from rig.mcap import message_definitions

Compression = Literal["zstd", "lz4", "none"]
COMPRESSIONS = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
LIBRARY = "inertia-uq"


@runtime_checkable
class RunOutput(Protocol):
    """The file or stream to which a run is written."""

    def write(self, data: bytes, /) -> int:
        """Take all of ``data``."""

    def tell(self) -> int:
        """Bytes taken so far."""

    def flush(self) -> None:
        """Pass everything on."""


def new_writer(stream: RunOutput, *, compression: Compression = "zstd", chunk_size: int = 2**18) -> Writer:
    """An MCAP writer of profile ros2 whose data section ends with a checksum."""
    writer = Writer(
        cast(IO[bytes], stream), compression=COMPRESSIONS[compression], chunk_size=chunk_size, enable_data_crcs=True
    )
    writer._Writer__chunk_indices = _SpooledIndexes()  # type: ignore[attr-defined]
    writer.start(profile="ros2", library=LIBRARY)
    return writer


class _SpooledIndexes:
    """The writer's list of chunk indexes in a nameless temporary file, so that a long run needs no more memory."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(2**16)  # noqa: SIM115 - closed by write

    def append(self, index: ChunkIndex) -> None:
        """Take one more."""
        builder = RecordBuilder()
        index.write(builder)
        self._file.write(builder.end())

    def __iter__(self) -> Iterator["_SpooledIndexes"]:
        """All in one, for the writer, which writes each."""
        yield self

    def write(self, builder: RecordBuilder) -> None:
        """Write them all."""
        with self._file as file:
            file.seek(0)
            builder.write(file.read())


def register(writer: Writer, type_name: str, topic: str) -> int:
    """Add a CDR channel of this ROS 2 type, with its full definition; returns its id."""
    definition = message_definitions.DEFINITIONS[type_name]
    schema_id = writer.register_schema(type_name, "ros2msg", definition.encode())
    return writer.register_channel(topic, "cdr", schema_id)
