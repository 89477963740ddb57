"""Samples and estimate for a viewer, Foxglove, over a WebSocket on this machine.

Messages are passed on as they were written, so that every topic shows in its own type; the estimate is a JSON topic. A
viewer that is slow or absent loses messages and holds up nobody.
"""

from typing import Any

from mcap.records import Channel, Schema

from identify.rigid_body.inertia import COMPONENTS
from rig.exceptions import RigError
from uq.live.live_estimate import LiveEstimate
from uq.live.loopback_gate import LoopbackGate, hidden_address

TOPIC = "/estimate"
BACKLOG = 2**14
"""Messages that wait for a viewer, at most."""
NUMBER = {"type": "number"}
FIGURES = ("value", "standard_uncertainty", "low", "high")
SCHEMA: dict[str, Any] = {
    "title": "inertia_uq.Estimate",
    "type": "object",
    "description": "inertia tensor about the centre of gravity, body frame, kg m^2; low and high: interval of 95 %",
    "properties": {
        "seconds": NUMBER | {"description": "of motion"},
        "text": {"type": "string"},
        **{name: {"type": "object", "properties": dict.fromkeys(FIGURES, NUMBER)} for name in COMPONENTS},
    },
}


class Viewer:
    """A server for viewers.

    Attributes:
        address: where to connect to.
    """

    def __init__(self, port: int) -> None:
        """Listen on a port of this machine; 0: on any that is free.

        Raises:
            RigError: foxglove-sdk is missing, or the port is taken.
        """
        try:
            import foxglove
        except ModuleNotFoundError:
            raise RigError("--live needs foxglove-sdk: `pip install inertia-uq[live]` installs it") from None
        self._foxglove, self._context = foxglove, foxglove.Context()
        try:
            host = hidden_address()
            self._server = self._started(host)
        except (RuntimeError, OSError):  # of 127.0.0.0/8 the system has 127.0.0.1 alone
            host = "127.0.0.1"
            self._server = self._started(host)
        try:
            self._gate = LoopbackGate(port, (host, self._server.port))
        except OSError as error:
            self._server.stop()
            raise RigError(f"--live cannot listen on port {port} ({error}): name another, or 0 for any") from None
        self.address = f"ws://127.0.0.1:{self._gate.port}"
        self._channels: dict[int, Any] = {}
        self._estimates = foxglove.Channel(TOPIC, schema=SCHEMA, context=self._context)
        self._last = 0

    def _started(self, host: str) -> Any:
        """The server, on any free port of an address that the gate alone knows."""
        return self._foxglove.start_server(
            name="inertia record", host=host, port=0, context=self._context, message_backlog_size=BACKLOG
        )

    def pass_on(self, channel: Channel, schema: Schema, log_time: int, data: bytes) -> None:
        """Send a message as it was written."""
        if channel.id not in self._channels:
            described = self._foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
            self._channels[channel.id] = self._foxglove.Channel(
                channel.topic, message_encoding=channel.message_encoding, schema=described, context=self._context
            )
        self._channels[channel.id].log(data, log_time=log_time)
        self._last = max(self._last, log_time)

    def show(self, estimate: LiveEstimate, text: str) -> None:
        """Send an estimate, at the time of the last message."""
        message: dict[str, Any] = {"seconds": estimate.seconds, "text": text}
        if not estimate.undetermined:
            rows = zip(estimate.inertia, estimate.standard_uncertainty, *estimate.interval95.T, strict=True)
            for name, row in zip(COMPONENTS, rows, strict=True):
                message[name] = dict(zip(FIGURES, map(float, row), strict=True))
        self._estimates.log(message, log_time=self._last)
