"""A client of Foxglove's WebSocket protocol, for the tests."""

import asyncio
import contextlib
import json
import struct

from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

MESSAGE = struct.Struct("<BIQ")


async def heard(address, topics, enough, seconds=60):
    """Messages of these topics, (channel, time, data) each, until ``enough`` says so."""
    request = HTTPRequest(address, headers={"Sec-WebSocket-Protocol": "foxglove.sdk.v1"})
    socket, wanted, messages = await websocket_connect(request), {}, []

    async def listen():
        while not enough(messages):
            message = await socket.read_message()
            assert message is not None, "the server went"
            if isinstance(message, str):
                document = json.loads(message)
                new = {c["id"]: c for c in document.get("channels", ()) if c["topic"] in topics}
                if document["op"] == "advertise" and new:
                    wanted.update(new)
                    subscriptions = [{"id": number, "channelId": number} for number in new]
                    await socket.write_message(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
            elif message[0] == 1:
                _, number, time = MESSAGE.unpack_from(message)
                messages.append((wanted[number], time, message[MESSAGE.size :]))

    async def closed():
        socket.close()
        while await socket.read_message() is not None:
            pass

    try:
        await asyncio.wait_for(listen(), seconds)
    finally:  # else the loop ends before the connection does, and its socket is found open in a later test
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(closed(), 10)
    return messages
