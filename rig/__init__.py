"""The sensors: real load cells and IMUs over serial ports, recorded to MCAP with nothing lost, and read back fast.

``read`` and ``write`` move runs between files and arrays, ``Recorder`` records what a rig file describes, ``recover``
saves what a cut or damaged file still holds, ``inspect`` looks at the health of its channels. Each name is imported on
first use. numpy, pyserial and mcap only: recording starts at once and never waits for JAX.

Rooms: ``rig.devices`` (one file per device family, bytes to samples and back, without I/O), ``rig.record`` (ports,
clocks, the growing file), ``rig.mcap`` (the file format), ``rig.bags`` (foreign containers and encodings),
``rig.inspection``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rig.bags.marks import read_marks
    from rig.channels import ImuChannel, MotionChannel, Recording, WrenchChannel
    from rig.devices import create_device
    from rig.devices.base import Device
    from rig.exceptions import RigError
    from rig.inspection.inspect import Inspection, inspect
    from rig.inspection.suspicions import Finding
    from rig.mcap.recover import Recovery, recover
    from rig.record.discover import discover
    from rig.record.recorder import Recorder, Summary
    from rig.record.rig_file import Rig, load_rig
    from rig.runs import read, read_any, write

__all__ = [
    "Device",
    "Finding",
    "ImuChannel",
    "Inspection",
    "MotionChannel",
    "Recorder",
    "Recording",
    "Recovery",
    "Rig",
    "RigError",
    "Summary",
    "WrenchChannel",
    "create_device",
    "discover",
    "inspect",
    "load_rig",
    "read",
    "read_any",
    "read_marks",
    "recover",
    "write",
]

_NAMES = {
    "rig.bags.marks": ("read_marks",),
    "rig.channels": ("ImuChannel", "MotionChannel", "Recording", "WrenchChannel"),
    "rig.devices": ("create_device",),
    "rig.devices.base": ("Device",),
    "rig.exceptions": ("RigError",),
    "rig.inspection.suspicions": ("Finding",),
    "rig.inspection.inspect": ("Inspection", "inspect"),
    "rig.mcap.recover": ("Recovery", "recover"),
    "rig.record.discover": ("discover",),
    "rig.record.recorder": ("Recorder", "Summary"),
    "rig.record.rig_file": ("Rig", "load_rig"),
    "rig.runs": ("read", "read_any", "write"),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _MODULES:
        raise AttributeError(f"module 'rig' has no attribute '{name}'")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
