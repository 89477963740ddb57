"""The devices, one file per family: bytes to samples and back, without I/O.

The name of an entry point of the group ``inertia_uq.devices`` is the device's ``kind`` in a rig file.
"""

from importlib.metadata import entry_points

from rig.devices.base import Device
from rig.exceptions import RigError, quoted

ENTRIES = entry_points(group="inertia_uq.devices")


def kinds() -> tuple[str, ...]:
    """The kinds of all devices, without importing them."""
    return tuple(sorted(ENTRIES.names))


def device_class(kind: str) -> type[Device]:
    """The class of a kind of device.

    Raises:
        RigError: the kind is unknown.
    """
    if kind not in kinds():
        # a kind of more letters is no mistyped one; in full it would make the line too long
        raise RigError(f"unknown kind {quoted(kind[:20])}: choose {', '.join(kinds())}")
    return ENTRIES[kind].load()


def create_device(kind: str, **options: object) -> Device:
    """The device of this kind with these options (see the class of each device for what it takes).

    Raises:
        RigError: the kind or an option is unknown, or an option has a wrong value.
    """
    return device_class(kind)(**options)
