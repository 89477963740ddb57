"""The sensors: real load cells and IMUs over serial ports, recorded to MCAP with nothing lost, and read back fast.

``read`` and ``write`` move runs between files and arrays, ``Recorder`` records what a rig file describes, ``recover``
saves what a cut or damaged file still holds, ``inspect`` looks at the health of its channels. Each name is imported on
first use. numpy, pyserial and mcap only: recording starts at once and never waits for JAX.

Rooms: ``rig.devices`` (one file per device family, bytes to samples and back, without I/O), ``rig.record`` (ports,
clocks, the growing file), ``rig.mcap`` (the file format), ``rig.bags`` (foreign containers and encodings),
``rig.inspection``.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what editors and type checkers see
    from rig.channels import ImuChannel as ImuChannel
    from rig.channels import Recording as Recording
    from rig.channels import WrenchChannel as WrenchChannel
    from rig.devices import create_device as create_device
    from rig.devices.base import Device as Device
    from rig.exceptions import RigError as RigError
    from rig.inspection.inspect import inspect as inspect
    from rig.mcap.recover import recover as recover
    from rig.record.discover import discover as discover
    from rig.record.recorder import Recorder as Recorder
    from rig.record.rig_file import load_rig as load_rig
    from rig.runs import read as read
    from rig.runs import read_any as read_any
    from rig.runs import write as write

_ROOMS = {
    "Device": "rig.devices.base",
    "ImuChannel": "rig.channels",
    "Recorder": "rig.record.recorder",
    "Recording": "rig.channels",
    "RigError": "rig.exceptions",
    "WrenchChannel": "rig.channels",
    "create_device": "rig.devices",
    "discover": "rig.record.discover",
    "inspect": "rig.inspection.inspect",
    "load_rig": "rig.record.rig_file",
    "read": "rig.runs",
    "read_any": "rig.runs",
    "recover": "rig.mcap.recover",
    "write": "rig.runs",
}
__all__ = list(_ROOMS)

if not TYPE_CHECKING:  # hidden from them: a name that is not public is an error, not Any

    def __getattr__(name: str) -> object:
        if name not in _ROOMS:
            raise AttributeError(f"module 'rig' has no attribute '{name}'")
        return getattr(import_module(_ROOMS[name]), name)

    def __dir__() -> list[str]:
        return sorted(_ROOMS)
