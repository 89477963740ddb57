"""A rig file of two emulated devices that play a ramp."""

from tests.helpers.rig_lab import ramp_run

EMULATED = """
[[device]]
name = "cell"
kind = "bota"
port = "emulator:ramp.mcap"
wrench = "on_sensor"
rotation_to_body = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
options = { rate = 800 }

[[device]]
name = "imu"
kind = "xsens"
port = "emulator:ramp.mcap?skew_ppm=80"
baudrate = 921600
options = { rate = 400 }
"""


def emulated_rig(folder):
    """Write both into a folder."""
    ramp_run(folder / "ramp.mcap", seconds=3.0)
    (folder / "rig.toml").write_text(EMULATED)
    return folder / "rig.toml"
