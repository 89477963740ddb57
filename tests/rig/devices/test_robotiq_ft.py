"""Robotiq FT 300 against the frames of its manual, and against checksums of another library (`crc` 8.0)."""

import pytest

from rig.devices import robotiq_ft
from rig.devices.checksums import crc16_modbus
from tests.helpers.rig_samples import only

FRAME = bytes.fromhex("204e 7b00 85ff d503 7d00 83ff 1f00 71cd")


def test_its_checksum_is_that_of_modbus():
    assert crc16_modbus(b"123456789") == 0x4B37


def test_requests_are_those_of_the_manual():
    assert robotiq_ft.read_request(180, 1) == bytes.fromhex("09 03 00 b4 00 01 c5 64")
    assert robotiq_ft.read_request(180, 6) == bytes.fromhex("09 03 00 b4 00 06 84 a6")
    assert bytes.fromhex("09 10 01 9a 00 01 02 02 00 cd ca") == robotiq_ft.START_STREAM


def test_a_frame_in_newtons_and_newton_metres():
    sample = only(robotiq_ft.RobotiqParser(), FRAME)
    assert sample.values == (1.23, -1.23, 9.81, 0.125, -0.125, 0.031)
    assert robotiq_ft.encode(sample.values) == FRAME


def test_a_force_beyond_the_range_is_limited_not_wrapped():
    sample = only(robotiq_ft.RobotiqParser(), robotiq_ft.encode((1e3, -1e3, 0.0, 0.0, 0.0, 0.0)))
    assert sample.values[:2] == (327.67, -327.68)


@pytest.mark.parametrize(
    ("heard", "registers"),
    [
        ("09 03 06 46 54 53 01 02 03 78 3a", "465453010203"),
        ("ff 03 00 09 03 06 46 54 53 01 02 03 78 3a 20", "465453010203"),
        ("09 03 06 46 54 53 01 02 03 78 3b", None),
        ("09 03 06 46 54 53 01 02 03 78", None),
    ],
)
def test_an_answer_in_what_was_heard(heard, registers):
    found = robotiq_ft.find_registers(bytes.fromhex(heard), 3)
    assert found == (None if registers is None else bytes.fromhex(registers))


def test_a_gripper_at_the_same_address_is_not_taken_for_the_sensor():
    assert robotiq_ft.find_firmware(robotiq_ft.message(3, 6, *b"G2F\1\2\3")) is None
    assert robotiq_ft.find_firmware(robotiq_ft.message(3, 6, *b"FTS\1\2\3")) == b"FTS\1\2\3"
