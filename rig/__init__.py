"""The sensors: real load cells and IMUs over serial ports, recorded to MCAP with nothing lost, and read back fast.

``rig.bag`` reads and writes runs, ``rig.devices`` holds one file per device family (bytes to samples and back, without
I/O), ``rig.recorder`` records, ``rig.recover`` saves what a cut or damaged file still holds, ``rig.inspection`` looks
for what is wrong with a run. numpy, pyserial and mcap only: recording starts at once and never waits for JAX.
"""
