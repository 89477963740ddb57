"""What a viewer gets: messages as they were written, and the estimate, through Foxglove's protocol by another client."""

import asyncio
import json
import re

import pytest
from mcap.records import Channel, Schema

from rig.exceptions import RigError
from rig.mcap import cdr_encode, message_definitions
from tests.foxglove_client import heard
from uq.live.second_process import LAYOUT
from uq.live.viewer import FIGURES, TOPIC, Viewer


def test_messages_pass_as_they_were_written():
    viewer = Viewer(0)
    definition = message_definitions.DEFINITIONS[message_definitions.WRENCH].encode()
    schema = Schema(id=1, name=message_definitions.WRENCH, encoding="ros2msg", data=definition)
    channel = Channel(id=7, topic="/wrench", message_encoding="cdr", metadata={}, schema_id=1)
    data = cdr_encode.WrenchEncoder("body")(123, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)

    async def both():
        viewer.pass_on(channel, schema, 100, data)  # announces the channel
        task = asyncio.create_task(heard(viewer.address, {"/wrench"}, len))
        while not task.done():
            await asyncio.sleep(0.05)
            viewer.pass_on(channel, schema, 456, data)
        return await task

    ((described, time, received),) = asyncio.run(both())
    assert (described["schemaName"], described["encoding"], described["schemaEncoding"]) == (
        schema.name,
        "cdr",
        "ros2msg",
    )
    assert described["schema"].encode() == definition
    assert (time, received) == (456, data)


def test_a_port_that_is_taken_is_named():
    first = Viewer(0)
    port = first.address.rpartition(":")[2]
    with pytest.raises(RigError, match=f"cannot listen on port {port}"):
        Viewer(int(port))


def test_the_layout_names_topics_and_fields_that_there_are():
    layout = json.loads(LAYOUT.read_text())
    paths = [p["value"] for c in layout["configById"].values() for p in c.get("paths", [{"value": c.get("topicPath")}])]
    definitions = {
        "/wrench": message_definitions.DEFINITIONS[message_definitions.WRENCH],
        "/imu": message_definitions.DEFINITIONS[message_definitions.IMU],
    }
    for path in paths:
        topic, *fields = path.split(".")
        if topic == TOPIC:
            assert fields == ["text"] or (fields[0].startswith("I") and fields[1] in FIGURES)
        else:
            assert all(re.search(rf"\b{field}\b", definitions[topic]) for field in fields)

    def panels(node):
        return [node] if isinstance(node, str) else panels(node["first"]) + panels(node["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
