"""The sensors: real load cells and IMUs over serial ports, recorded to MCAP with nothing lost, and read back fast.

``rig.runs`` reads and writes runs, ``rig.devices`` holds one file per device family (bytes to samples and back, without
I/O), ``rig.record.recorder`` records, ``rig.mcap.recover`` saves what a cut or damaged file still holds,
``rig.inspection.inspect`` looks for what is wrong with a run. numpy, pyserial and mcap only: recording starts at once
and never waits for JAX.
"""
