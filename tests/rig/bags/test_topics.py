"""Topics as arrays: messages that change in their number of values."""

import pytest

from rig.bags.topics import load
from rig.exceptions import RigError
from rig.mcap import cdr
from rig.mcap.message_definitions import JOINTS
from rig.mcap.writer import new_writer, register


def test_velocities_that_stop_between_chunks_end_in_one_line(tmp_path):
    path = tmp_path / "run.mcap"
    with path.open("wb") as stream:
        writer = new_writer(stream, chunk_size=1)
        channel = register(writer, JOINTS, "/joint_states")
        encode = cdr.encoder(JOINTS, "", ("shoulder", "elbow"))
        for k, numbers in enumerate(([0.1, 0.2, 0.3, 0.4], [0.1, 0.2])):
            writer.add_message(channel, k, encode(k, numbers), k, k)
        writer.finish()
    with pytest.raises(RigError, match=r"topic /joint_states in .*changes from message to message: split the run"):
        load(path, only={JOINTS: None})
