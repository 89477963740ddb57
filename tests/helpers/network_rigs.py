"""Rig files of devices on a network, and the runs that their emulators play."""

import contextlib

from rig.record.rig_file import load_rig
from rig.record.session import Emulators

ATI = """
[[device]]
name = "cell"
kind = "ati-net-ft"
port = "{port}"
wrench = "on_body"
"""


@contextlib.contextmanager
def playing(folder, text):
    """The emulated devices of a rig file; gives them, and the rig file that names their sockets."""
    (folder / "emulated.toml").write_text(text)
    rig = load_rig(folder / "emulated.toml")
    emulators = Emulators(list(rig.entries), folder)
    try:
        for name, number in emulators.ports().items():
            entry = next(entry for entry in rig.entries if entry.name == name)
            text = text.replace(f'"{entry.port}"', f'"{number}"')
        (folder / "rig.toml").write_text(text)
        emulators.go()
        yield emulators, folder / "rig.toml"
    finally:
        emulators.close()


UR = """
[[device]]
name = "robot"
kind = "ur-rtde"
port = "{port}"
topic = "/wrist"
wrench = "on_sensor"
wrench_frame = "base"
compensated = "gravity"
rotation_to_body = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
options = {{ wrench_variable = "actual_TCP_force", values = ["actual_tool_accelerometer"] }}
"""
