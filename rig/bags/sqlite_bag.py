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

from rig.bags.message_batches import ForeignFile, Packer
from rig.exceptions import RigError
from rig.mcap.message_definitions import canonical
from rig.mcap.records import Batch, Definitions


class SqliteFile(ForeignFile):
    """A .db3 file."""

    def damage(self, why: str) -> RigError:
        """The error for a file that is cut or damaged."""
        return RigError(
            f"cut or damaged SQLite bag {self.name} ({why}): save what it holds with `sqlite3 {self.name} .recover`"
        )

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages of these types, a megabyte at a time."""
        self._check_whole()
        uri = f"file:{quote(os.path.abspath(self.path))}?mode=ro&immutable=1"
        try:
            with closing(sqlite3.connect(uri, uri=True)) as database:
                yield from self._messages(database, definitions, types)
        except (sqlite3.Error, OverflowError) as error:
            raise self.damage(str(error)) from error

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
        tables = {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            raise RigError(f"no rosbag2 recording {self.name}: an SQLite file without the tables topics and messages")
        topics = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
        for number, topic, kind, encoding in topics:
            definitions.schemas[number] = Schema(number, b"", "ros2msg", kind)
            definitions.channels[number] = Channel(number, topic, encoding, {}, number)
        wanted = [number for number, _, kind, _ in topics if canonical(kind) in types]
        packer, places = Packer(), ", ".join("?" * len(wanted))
        rows = database.execute(
            f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places}) ORDER BY id",  # noqa: S608
            wanted,
        )
        for topic_id, timestamp, data in rows:
            if not isinstance(timestamp, int) or not isinstance(data, bytes):
                raise self.damage("a message without time or data")
            try:
                packer.add(topic_id, timestamp, data)
            except ValueError as error:
                raise self.damage(str(error)) from error
            if packer.full:
                yield from packer.take()
        yield from packer.take()
