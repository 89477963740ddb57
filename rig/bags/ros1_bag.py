"""ROS 1 bags (.bag, version 2.0), by the optional package rosbags; their messages are decoded like all others."""

from collections.abc import Iterator
from pathlib import Path

from mcap.records import Channel, Schema

from rig.bags.message_batches import ForeignFile, Packer
from rig.exceptions import RigError, reason
from rig.mcap.message_definitions import canonical
from rig.mcap.records import Batch, Definitions


class Ros1File(ForeignFile):
    """A .bag file."""

    def damage(self, why: str) -> RigError:
        """The error for a file that is cut or damaged."""
        return RigError(f"cut or damaged ROS 1 bag {self.name} ({reason(why)}): repair a copy with `rosbag reindex`")

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages of these types, a megabyte at a time."""
        try:
            from rosbags.rosbag1 import Reader
        except ImportError:
            raise RigError(f"{self.name} is a ROS 1 bag: `pip install inertia-uq[bags]` reads it") from None
        packer = Packer()
        try:
            with Reader(Path(self.path)) as reader:
                for connection in reader.connections:
                    number = connection.id
                    definitions.schemas[number] = Schema(number, b"", "ros1msg", connection.msgtype)
                    definitions.channels[number] = Channel(number, connection.topic, "ros1", {}, number)
                wanted = [item for item in reader.connections if canonical(item.msgtype) in types]
                for connection, time, data in reader.messages(wanted) if wanted else ():
                    packer.add(connection.id, time, bytes(data))
                    if packer.full:
                        yield from packer.take()
        except (GeneratorExit, RigError, OSError):
            raise
        except Exception as error:  # rosbags lets out what struct, bz2 and lz4 raise of a damaged file
            raise self.damage(str(error).splitlines()[0] if str(error) else type(error).__name__) from error
        yield from packer.take()
