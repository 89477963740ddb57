"""rosbag2's SQLite container (.db3): the tables ``topics`` and ``messages``, read in place and never changed.

By Python's own SQLite and not by rosbags: no extra to install, no longer than a call of rosbags with its errors, and
rosbags passes over the messages in an unfinished bag's journal in silence (0.11.9, tried).
"""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from mcap.records import Channel, Schema

from rig.bags.message_packing import FULL, ContainerFile, Packer
from rig.exceptions import RigError, listed
from rig.mcap.message_definitions import canonical
from rig.mcap.records import Batch, Definitions

STEPS, LEAST_STEPS, STEPS_PER_BYTE = 2**16, 2**25, 10
"""Steps of SQLite's machine: between two looks at their sum; what any file may take; more for each of its bytes.

A sound file takes fewer than it has bytes.
"""
TOPIC = 2**12
"""Bytes that a topic counts for beside its texts."""


class SqliteFile(ContainerFile):
    """A rosbag2 recording in SQLite, a .db3 file."""

    def damage(self, why: str) -> RigError:
        """The error for a file that is cut or damaged."""
        return RigError(
            f"cut or damaged SQLite bag {self.name} ({why}): save what it holds with `sqlite3 {self.name} .recover`"
        )

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages of these types, a megabyte at a time."""
        self.budget.reached(os.path.getsize(self.path))
        self._check_whole()
        uri = f"file:{quote(os.path.abspath(self.path))}?mode=ro&immutable=1"
        try:
            with closing(sqlite3.connect(uri, uri=True)) as database:
                yield from self._messages(database, definitions, types)
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            raise self.damage(listed([str(error)])) from error

    def _check_whole(self) -> None:
        """Refuse a file that is shorter than its own header says, or whose last messages are still in its journal."""
        with open(self.path, "rb") as stream:
            header = stream.read(100)
        page = int.from_bytes(header[16:18], "big")
        size = (65536 if page == 1 else page) * int.from_bytes(header[28:32], "big")
        if len(header) < 100 or os.path.getsize(self.path) < size:
            raise self.damage("it ends early")
        journal = Path(f"{os.fspath(self.path)}-wal")
        if journal.is_file() and journal.stat().st_size:
            raise RigError(
                f"unfinished SQLite bag {self.name}: its last messages are in {journal.name}; "
                "finish a copy of both with `sqlite3 COPY.db3 'PRAGMA wal_checkpoint(TRUNCATE)'`"
            )

    def _messages(self, database: sqlite3.Connection, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        self._limit(database)
        for table in ("topics", "messages"):
            self._check_table(database, table)
        wanted = []
        for row in database.execute("SELECT id, name, type, serialization_format FROM topics"):
            number, topic, kind, encoding = self._topic(row)
            definitions.schemas[number] = Schema(number, b"", "ros2msg", kind)
            definitions.channels[number] = Channel(number, topic, encoding, {}, number)
            if canonical(kind) in types:
                wanted.append(number)
        packer, places = Packer(), ", ".join("?" * len(wanted))
        rows = database.execute(  # as the table stands: by its key, which is the order of writing, and never sorted
            f"SELECT topic_id, timestamp, data FROM messages NOT INDEXED WHERE topic_id IN ({places})",  # noqa: S608
            wanted,
        )
        for topic_id, timestamp, data in rows if wanted else ():
            if not isinstance(topic_id, int) or not isinstance(timestamp, int) or not isinstance(data, bytes):
                raise self.damage("a message without time or data")
            self.budget.take(len(data))
            try:
                packer.add(topic_id, timestamp, data)
            except ValueError as error:
                raise self.damage(str(error)) from error
            yield from packer.take(FULL)
        yield from packer.take()

    def _limit(self, database: sqlite3.Connection) -> None:
        """Bound the size of a value and the steps of a query: a damaged file's pages may lead in circles."""
        database.text_factory = lambda data: data.decode("utf-8", "replace")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self.budget.piece)
        database.execute("PRAGMA trusted_schema = OFF")
        remaining = LEAST_STEPS + STEPS_PER_BYTE * os.path.getsize(self.path)

        def exhausted() -> bool:
            nonlocal remaining
            remaining -= STEPS
            return remaining < 0

        database.set_progress_handler(exhausted, STEPS)

    def _check_table(self, database: sqlite3.Connection, name: str) -> None:
        """Refuse a table that is missing, or whose values are computed and not stored."""
        query = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?"
        (sql,) = database.execute(query, (name,)).fetchone() or (None,)
        if sql is None:
            raise RigError(f"no rosbag2 recording {self.name}: an SQLite file without the tables topics and messages")
        stored = not str(sql).upper().startswith("CREATE VIRTUAL")
        computed = [row[6] for row in database.execute(f"PRAGMA table_xinfo({name})") if row[6]]
        if computed or not stored:
            raise RigError(f"no rosbag2 recording {self.name}: its table {name} is computed, not stored")

    def _topic(self, row: tuple[object, ...]) -> tuple[int, str, str, str]:
        """Number, name, type and encoding of a topic."""
        number, topic, kind, encoding = row
        texts = isinstance(topic, str) and isinstance(kind, str) and isinstance(encoding, str)
        if not isinstance(number, int) or not 0 <= number < 2**16 or not texts:
            raise self.damage("a topic without number, name or type")
        self.budget.take(TOPIC + len(f"{topic}{kind}{encoding}"))
        return number, str(topic), str(kind), str(encoding)
