"""What a viewer gets: messages as they were written, and the estimate, through Foxglove's protocol by another client."""

import asyncio
import json
import re
import socket
import sys
import time

import pytest
from mcap.records import Channel, Schema

from rig.exceptions import RigError
from rig.mcap import cdr, message_definitions
from tests.helpers.foxglove_client import heard
from uq.live.foxglove_server import FIGURES, HEAD, MOST, TOPIC, LoopbackGate, Viewer
from uq.live.second_process import LAYOUT


def test_messages_pass_as_they_were_written():
    viewer = Viewer(0)
    definition = message_definitions.DEFINITIONS[message_definitions.WRENCH].encode()
    schema = Schema(id=1, name=message_definitions.WRENCH, encoding="ros2msg", data=definition)
    channel = Channel(id=7, topic="/wrench", message_encoding="cdr", metadata={}, schema_id=1)
    data = cdr.encoder(message_definitions.WRENCH, "body")(123, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))

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


HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: {}\r\n{}Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


def status(address, request):
    """The first line of what a plain socket is answered."""
    host, port = address.removeprefix("ws://").split(":")
    with socket.create_connection((host, int(port)), 10) as plain:
        plain.sendall(request)
        answer = b""
        while b"\r\n" not in answer and (data := plain.recv(4096)):
            answer += data
    return answer.partition(b"\r\n")[0].decode()


@pytest.fixture(scope="module")
def viewer():
    return Viewer(0)


@pytest.mark.parametrize(
    "origin", ["", *("https://app.foxglove.dev", "file://", "http://localhost:8080", "http://[::1]")]
)
@pytest.mark.parametrize("host", ["127.0.0.1:8765", "localhost", "[::1]:8765"])
def test_programs_and_pages_of_this_machine_and_foxglove_connect(viewer, host, origin):
    head = HANDSHAKE.format(host, origin and f"Origin: {origin}\r\n")
    assert status(viewer.address, head.encode()) == "HTTP/1.1 101 Switching Protocols"


@pytest.mark.parametrize(
    ("host", "origin"),
    [("localhost", "https://evil.example"), ("localhost", "null"), ("localhost", "https://app.foxglove.dev.evil.example"),
     ("localhost", "https://localhost.evil.example"), ("localhost", "http://[::1"), ("localhost", "chrome-extension://x"),
     ("localhost", "https://localhost@evil.example"), ("evil.example:8765", ""), ("evil.example", "http://evil.example"),
     ("192.0.2.1", ""), ("", ""), ("localhost\r\nHost: evil.example", "")],
)  # fmt: skip
def test_other_pages_and_other_names_are_refused(viewer, host, origin):
    """A page of another site (cross-site hijacking), and a name that leads here for a while (DNS rebinding)."""
    head = HANDSHAKE.format(host, origin and f"Origin: {origin}\r\n")
    assert status(viewer.address, head.encode()) == "HTTP/1.1 403 Forbidden"


def test_what_is_no_request_is_dropped_and_others_still_connect(viewer):
    assert status(viewer.address, b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n") == "HTTP/1.1 403 Forbidden"
    assert status(viewer.address, b"x" * 2 * HEAD) == ""
    host, port = viewer.address.removeprefix("ws://").split(":")
    idle = [socket.create_connection((host, int(port))) for _ in range(MOST + 4)]  # they say nothing
    for plain in idle:
        plain.close()
    deadline = time.monotonic() + 10
    while status(viewer.address, HANDSHAKE.format("localhost", "").encode()) != "HTTP/1.1 101 Switching Protocols":
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_server_behind_the_gate_is_where_no_page_looks(viewer):
    if sys.platform != "linux":
        pytest.skip("only 127.0.0.1 is an address of this machine")
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", viewer._server.port), 1).close()


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


def test_a_request_that_trickles_in_ends_in_time(monkeypatch):
    """A byte at a time, each within the limit for the whole: else sixteen of them keep everybody out."""
    monkeypatch.setattr("uq.live.foxglove_server.PATIENCE", 0.2)
    gate = LoopbackGate(0, ("127.0.0.1", 9))

    def trickle(client):
        for _ in range(100):
            client.sendall(b"G")
            time.sleep(0.02)

    with socket.create_connection(("127.0.0.1", gate.port)) as client, pytest.raises(OSError, match=r"reset|[Pp]ipe"):
        trickle(client)
