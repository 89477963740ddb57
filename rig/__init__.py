"""The sensors: real load cells and IMUs over serial ports, recorded to MCAP with nothing lost, and read back fast.

``read`` and ``write`` move runs between files and arrays, ``Recorder`` records what a rig file describes, ``recover``
saves what a cut or damaged file still holds, ``inspect`` looks at the health of its channels. Each name is imported on
first use. numpy, pyserial and mcap only: recording starts at once and never waits for JAX.

Rooms: ``rig.devices`` (one file per device family, bytes to samples and back, without I/O), ``rig.record`` (ports,
clocks, the growing file), ``rig.mcap`` (the file format), ``rig.bags`` (foreign containers and encodings),
``rig.inspection``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)  # the names stand in __init__.pyi
