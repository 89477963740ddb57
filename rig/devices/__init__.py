"""The devices: one file per family, bytes to samples and back, without I/O. A new device is a file and a line here."""

from importlib import import_module

from rig.devices.base import Device
from rig.exceptions import RigError

REGISTRY = {
    "bota": "rig.devices.bota:Bota",
    "robotous": "rig.devices.robotous:Robotous",
    "xsens": "rig.devices.xsens:Xsens",
    "microstrain": "rig.devices.microstrain:MicroStrain",
    "vectornav": "rig.devices.vectornav:VectorNav",
    "vectornav-ascii": "rig.devices.vectornav_ascii:VectorNavAscii",
    "line": "rig.devices.line:Line",
}


def create_device(kind: str, **options: object) -> Device:
    """The device of this kind with these options (see the class of each device for what it takes).

    Raises:
        RigError: the kind or an option is unknown, or an option has a wrong value.
    """
    if kind not in REGISTRY:
        raise RigError(f"unknown device kind '{kind}': choose one of {', '.join(REGISTRY)}")
    module, _, name = REGISTRY[kind].partition(":")
    return getattr(import_module(module), name)(**options)
