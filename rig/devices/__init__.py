"""The devices, one file per family: bytes to samples and back, without I/O.

The name of the file is the device's ``kind`` in a rig file, with ``-`` for ``_``.
"""

from importlib import import_module
from pkgutil import iter_modules

from rig.devices.base import Device
from rig.exceptions import RigError, quoted

SHARED = ("base", "checksums", "conversation", "parser")
"""Modules here that are no device."""


def kinds() -> tuple[str, ...]:
    """The kinds of all devices, without importing them."""
    return tuple(
        sorted(module.name.replace("_", "-") for module in iter_modules(__path__) if module.name not in SHARED)
    )


def device_class(kind: str) -> type[Device]:
    """The class of a kind of device.

    Raises:
        RigError: the kind is unknown.
    """
    if kind not in kinds():
        raise RigError(f"unknown device kind {quoted(kind)}: choose one of {', '.join(kinds())}")
    module = import_module(f"{__name__}.{kind.replace('-', '_')}")
    classes = [item for item in vars(module).values() if isinstance(item, type) and item.__module__ == module.__name__]
    return next(item for item in classes if issubclass(item, Device))


def create_device(kind: str, **options: object) -> Device:
    """The device of this kind with these options (see the class of each device for what it takes).

    Raises:
        RigError: the kind or an option is unknown, or an option has a wrong value.
    """
    return device_class(kind)(**options)
