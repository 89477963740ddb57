"""The ports of the machine, under names that stay, and the device that answers on each."""

import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from rig.devices import create_device, device_class, kinds
from rig.devices.conversation import Identity, NoAnswerError
from rig.exceptions import RigError
from rig.record.port import PortLostError, converse, on_network, open_port

BY_ID = Path("/dev/serial/by-id")


@dataclass(frozen=True)
class DiscoveredPort:
    """One port: its stable name, what it is, and the device that answered, or why none could be asked."""

    name: str
    description: str
    kind: str = ""
    identity: Identity | None = None
    complaint: str = ""


def ports() -> list[tuple[str, str]]:
    """(stable name, description) of every serial port that has hardware behind it."""
    stable = {os.path.realpath(link): str(link) for link in BY_ID.iterdir()} if BY_ID.is_dir() else {}
    present = [(p.device, p.description) for p in list_ports.comports() if p.hwid != "n/a"]
    return sorted((stable.get(os.path.realpath(device), device), text) for device, text in present)


def discover(names: Sequence[str] | None = None) -> list[DiscoveredPort]:
    """Ask every port, or those named, for a device of each kind that answers questions.

    This sends each kind's identification commands down the port; name ports with ``names`` where other equipment must
    not be disturbed.
    """
    chosen = ports() if names is None else [(name, "") for name in names]
    return [_ask(name, description) for name, description in chosen]


def _ask(name: str, description: str) -> DiscoveredPort:
    for kind in kinds():
        device = device_class(kind)
        if not device.ASKED or (name[:3] if on_network(name) else "") != device.NETWORK:
            continue
        try:
            return DiscoveredPort(name, description, kind=kind, identity=_identify(name, kind))
        except (NoAnswerError, PortLostError):
            continue
        except RigError as error:
            return DiscoveredPort(name, description, complaint=str(error))
    return DiscoveredPort(name, description)


def _identify(name: str, kind: str) -> Identity:
    device = create_device(kind)
    with closing(open_port(name, device.BAUDRATE, device.NUMBER)) as port:
        identity = converse(device.start(), port)
        port.write(device.stop())
    return identity


def table(discovered: Sequence[DiscoveredPort]) -> list[str]:
    """The findings, a line a port."""
    if not discovered:
        return ["no serial ports: plug a device in, or check that the adapter's driver is loaded"]
    return [f"{item.name}  {_what(item)}" for item in discovered]


def _what(item: DiscoveredPort) -> str:
    if item.complaint:
        return item.complaint
    if item.identity is None:
        return f"no known device answers ({item.description or 'no description'})"
    identity = item.identity
    return f"kind '{item.kind}': {identity.model} serial {identity.serial} firmware {identity.firmware}"
