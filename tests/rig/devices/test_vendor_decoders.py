"""The vendors' own decoders read our emulators as our parsers do: Bota's driver, MicroStrain's MSCL."""

import json
import os
import select
import subprocess
import sys
import threading
import time
import tty

import numpy as np
import pytest

from rig.devices import bota, microstrain
from tests.helpers.rig_lab import Bench

DRIVER = """
import json, sys
import bota_driver as b

config = b.BotaDriverConfig()
config.communication_interface_name = "Bota_Binary_gen0"
config.product_name = "BFT-SENS-SER-M8"
config.serial_number = "E-0001"
config.driver_operation_params = b.DriverOperationConfig()
config.driver_operation_params.skip_metadata_reading = True
config.driver_operation_params.register_with_daemon = False
config.binary_communication_interface_params = b.BotaBinaryCommunicationInterfaceConfig()
config.binary_communication_interface_params.baudrate = 460800
config.binary_communication_interface_params.com_port = sys.argv[1]
config.gen0_sensor_operation_params = b.Gen0SensorOperationConfig()
config.gen0_sensor_operation_params.sinc_length = 512
driver = b.BotaDriver(config)
rows = []
if driver.configure() and driver.activate():
    for _ in range(int(sys.argv[2])):
        frame = driver.read_frame_blocking()
        rows.append([frame.timestamp, *frame.force, *frame.torque, frame.temperature, frame.status.val])
driver.deactivate(), driver.cleanup(), driver.shutdown()
print("RESULT" + json.dumps(rows))
"""


class Tap(threading.Thread):
    """Passes bytes between a port and a terminal of its own, and keeps what comes from the port."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self._port = os.open(port, os.O_RDWR | os.O_NOCTTY)
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.name_of_other_end = os.ttyname(slave)
        self._slave = slave
        self.heard = bytearray()
        self.ended = False

    def run(self):
        while not self.ended:
            ready = select.select([self._port, self._master], [], [], 0.1)[0]
            if self._port in ready:
                data = os.read(self._port, 4096)
                self.heard += data
                os.write(self._master, data)
            if self._master in ready:
                os.write(self._port, os.read(self._master, 4096))

    def close(self):
        self.ended = True
        self.join()
        for handle in (self._port, self._master, self._slave):
            os.close(handle)


def test_botas_driver_decodes_our_emulator_as_our_parser_does(tmp_path):
    pytest.importorskip("bota_driver")
    with Bench(tmp_path) as bench:
        tap = Tap(bench.ports["cell"])
        tap.start()
        command = [sys.executable, "-c", DRIVER, tap.name_of_other_end, "50"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        tap.close()
    assert "RESULT" in done.stdout, done.stdout + done.stderr
    theirs = json.loads(done.stdout.rpartition("RESULT")[2].splitlines()[0])
    assert len(theirs) == 50
    parser = bota.BotaParser()
    ours = {sample.time // 1000: sample for sample in parser.feed(bytes(tap.heard))}
    for timestamp, *values, temperature, status in theirs:
        assert ours[timestamp].values == tuple(values)
        assert (temperature, status, ours[timestamp].flagged) == (25.0, 0, False)
    numbers = np.array(theirs[1:])  # the driver hands out its first frame twice
    np.testing.assert_allclose(np.diff(numbers[:, 0]), 10_000, atol=2)  # 512 * 19.53125 us
    np.testing.assert_allclose(np.diff(numbers[:, 1]), 0.01, atol=1e-5)  # the ramp grows by 1 N/s


def test_mscl_decodes_our_mip_packets_as_our_parser_does():
    """1,000 packets with values over the whole range of the sensor, decoded by MSCL from a terminal: difference 0."""
    mscl = pytest.importorskip("mscl")
    draw = np.random.default_rng(9)
    count = 1000
    values = np.concatenate([draw.normal(scale=3, size=(count, 3)), draw.normal(scale=20, size=(count, 3))], axis=1)
    packets = [microstrain.encode(10**9 + i * 10**6, tuple(r[:3]), tuple(r[3:])) for i, r in enumerate(values.tolist())]
    ours = microstrain.MipParser().feed(b"".join(packets))
    master, slave = os.openpty()
    tty.setraw(slave)
    connection = mscl.Connection.Serial(os.ttyname(slave), 921600)
    node = mscl.InertialNode(connection)
    theirs = []
    for i in range(0, count, 20):
        os.write(master, b"".join(packets[i : i + 20]))
        theirs += node.getDataPackets(200)
    deadline = time.monotonic() + 60
    while len(theirs) < count and time.monotonic() < deadline:
        theirs += node.getDataPackets(200)
    connection.disconnect()
    os.close(master)
    os.close(slave)
    assert len(theirs) == len(ours) == count
    for sample, packet in zip(ours, theirs, strict=True):
        points = {point.channelName(): point for point in packet.data()}
        rate = [points[f"scaledGyro{axis}"].as_float() for axis in "XYZ"]
        in_g = [points[f"scaledAccel{axis}"].as_float() for axis in "XYZ"]
        assert sample.values[:3] == tuple(rate)
        assert sample.values[3:] == tuple(a * microstrain.STANDARD_GRAVITY for a in in_g)
