"""The devices against the vectors of their protocols, both directions, and their conversations with their emulators."""

import re
import struct

import numpy as np
import pytest

from rig.devices import bota, create_device, kinds, microstrain, robotous, vectornav, vectornav_ascii, xsens
from rig.devices.base import Device
from rig.devices.checksums import crc16_x25
from rig.devices.conversation import Inquire, Listen, NoAnswerError, Send
from rig.exceptions import RigError
from tests.helpers.rig_samples import SHARED, only


def test_bota_vector():
    data = bytes.fromhex("aa00000000c03f000010c00ae81c410000003e000080bd0000003d15cd5b070000fc419e4b")
    values = (1.5, -2.25, 9.80665, 0.125, -0.0625, 0.03125)
    assert crc16_x25(b"123456789") == 0x906E
    assert bota.encode(values, microseconds=123456789, temperature=31.5) == data
    sample = only(bota.BotaParser(), data)
    assert sample.values == struct.unpack("<6f", struct.pack("<6f", *values))
    assert (sample.time, sample.flagged, sample.end) == (123456789000, False, 37)
    assert bota.BotaParser().feed(bota.encode(values, microseconds=0, status=2))[0].flagged


def test_bota_time_goes_on_beyond_its_wrap():
    parser, zeros = bota.BotaParser(), (0.0,) * 6
    times = [2**32 - 1000, 2**32 - 100, 2**32 + 900]
    got = [parser.feed(bota.encode(zeros, microseconds=t))[0].time for t in times]
    assert got == [t * 1000 for t in times]


def test_robotous_vectors():
    assert robotous.command(11) == bytes.fromhex("550b000000000000000baa")
    assert robotous.command(10) == bytes.fromhex("550a000000000000000aaa")
    data = bytes.fromhex("550b004bff9001ea00faff83003e0000008aaa")
    sample = only(robotous.RobotousParser(2000.0), data)
    assert sample.values == (1.5, -2.24, 9.8, 0.125, -0.0625, 0.031)
    assert robotous.encode(sample.values) == data
    assert robotous.RobotousParser(1000.0).feed(data)[0].values[3:] == (0.25, -0.125, 0.062)
    assert robotous.RobotousParser().feed(robotous.encode(sample.values, overload=0b100))[0].flagged


def test_xsens_vectors():
    assert xsens.message(xsens.GOTO_CONFIG) == bytes.fromhex("faff3000d1")
    assert xsens.message(0x31) == bytes.fromhex("faff3100d0")
    assert xsens.message(xsens.GOTO_MEASUREMENT) == bytes.fromhex("faff1000f1")
    assert xsens.message(xsens.MTDATA2) == bytes.fromhex("faff3600cb")
    for data in ("faff3000d1", "faff3100d0", "faffc00850400064201300c84a", "faff3600cb"):
        parser = xsens.XsensParser()
        parser.feed(bytes.fromhex(data))
        known = data[4:6] != "30" and data[4:6] != "c0"
        assert parser.counts.frames == known
    assert xsens.message(0xC0, bytes.fromhex("50400064201300c8")) == bytes.fromhex("faffc00850400064201300c84a")
    assert xsens.numbers(0x5041, bytes.fromhex("039adf0300be1f81")) == (57.67944622039795, 11.882691383361816)
    assert xsens.numbers(0x5042, bytes.fromhex("80000000ffff")) == (-0.5,)
    assert xsens.numbers(0x5043, struct.pack(">d", 1 / 3)) == (1 / 3,)


def test_xsens_round_trip():
    parser = xsens.XsensParser()
    rate, force = (0.5, -0.25, 2.0), (0.125, 9.75, -1.0)
    stream = b"".join(xsens.encode(k, 7 * k, rate, force) for k in (65534, 65535, 65537))
    samples = parser.feed(stream)
    assert [s.counter for s in samples] == [65534, 65535, 65537]
    assert [s.time for s in samples] == [700_000 * k for k in (65534, 65535, 65537)]
    assert {s.values for s in samples} == {rate + force}
    assert parser.counts.missing == 1


def test_a_counter_that_steps_back_is_not_a_gap():
    parser = xsens.XsensParser()
    stream = b"".join(xsens.encode(k, 0, (0.0,) * 3, (0.0,) * 3) for k in (5, 4, 6, 6, 10))
    assert [s.counter for s in parser.feed(stream)] == [5, 4, 6, 6, 10]
    assert parser.counts.missing == 1 + 3  # 4 to 6 and 6 to 10


@pytest.mark.skipif(not (SHARED / "xsens").is_dir(), reason="the sample data is not here")
@pytest.mark.parametrize("name", ["1", "2"])
def test_xsens_captures_decode_to_their_expected_values(name):
    """100 messages each; every number that the expected values list, error 0."""
    parser = xsens.XsensParser()
    frames = []
    parser.samples = lambda frame: frames.append(frame) or []
    data = (SHARED / "xsens" / f"{name}.output.bin").read_bytes()
    parser.feed(data)
    assert (parser.counts.frames, parser.counts.skipped, parser.counts.framed) == (100, 0, len(data))
    expected = (SHARED / "xsens" / f"{name}.output.golden").read_text().strip("\n").split("\n\n")
    assert len(expected) == 100
    for frame, text in zip(frames, expected, strict=True):
        check_capture(xsens.payload(frame), text)


KINDS = {
    "Acceleration": 0x4020,
    "DeltaV": 0x4010,
    "RateOfTurn": 0x8020,
    "DeltaQ": 0x8030,
    "EulerAngles": 0x2030,
    "LatLon": 0x5040,
    "AltitudeEllipsoid": 0x5020,
    "VelocityXYZ": 0xD010,
}


def check_capture(items, text):
    for name, values in re.findall(r"^(\S+):\n((?:  .*\n?)+)", text, re.M):
        kind = name.partition("(")[0]
        values = [line.strip().rpartition(":")[2] for line in values.strip("\n").split("\n")]
        if kind in KINDS:
            (key,) = [k for k in items if k & 0xFFF0 == KINDS[kind]]
            assert list(xsens.numbers(key, items[key])) == [float(v) for v in values], name
        elif kind in ("PacketCounter", "SampleTimeFine"):
            key = xsens.COUNTER if kind == "PacketCounter" else xsens.TIME_FINE
            assert int.from_bytes(items[key], "big") == int(values[0])
        elif kind == "StatusWord":
            assert f"{int.from_bytes(items[0xE020], 'big'):032b}" == values[0]


def other_message(counter):
    """A message that carries its counter and a temperature."""
    return xsens.message(xsens.MTDATA2, struct.pack(">HBHHBf", xsens.COUNTER, 2, counter, 0x0810, 4, 21.5))


def test_an_xsens_counts_messages_that_carry_no_sample():
    """Samples 9, 11, 12, 15 and a message of something else at 10 and 13: only 14 is missing."""
    zeros = (0.0,) * 3
    stream = [
        xsens.encode(k, 0, zeros, zeros) if k in (9, 11, 12, 15) else other_message(k) for k in (9, 10, 11, 12, 13, 15)
    ]
    parser = xsens.XsensParser()
    samples = parser.feed(b"".join(stream))
    assert parser.counts.missing == 1
    assert [sample.counter for sample in samples] == [9, 11, 12, 15]
    assert np.diff([sample.number for sample in samples]).tolist() == [1, 1, 2]


@pytest.mark.skipif(not (SHARED / "xsens").is_dir(), reason="the sample data is not here")
@pytest.mark.parametrize("name", ["1", "2"])
def test_xsens_captures_miss_nothing(name):
    parser = xsens.XsensParser()
    samples = parser.feed((SHARED / "xsens" / f"{name}.output.bin").read_bytes())
    assert parser.counts.missing == 0
    assert set(np.diff([sample.number for sample in samples])) == {1}


@pytest.mark.skipif(not (SHARED / "xsens").is_dir(), reason="the sample data is not here")
def test_xsens_captures_give_samples():
    parser = xsens.XsensParser()
    samples = parser.feed((SHARED / "xsens" / "1.output.bin").read_bytes())
    assert len(samples) == 96
    assert samples[0].values[5] == pytest.approx(-1.209552526473999, abs=0)
    assert (samples[0].counter, samples[0].time) == (43398, 51703123 * 100_000)


def test_microstrain_vectors():
    for command, data in ((1, "756501020201e0c6"), (2, "756501020202e1c7"), (6, "756501020206e5cb")):
        assert microstrain.packet(1, microstrain.field(command)) == bytes.fromhex(data)
    ack = microstrain.packet(1, microstrain.field(0xF1, b"\x06\x00"))
    assert ack == bytes.fromhex("7565010404f10600da74")
    data = bytes.fromhex(
        "7565804C0AD5000000055EE67CC00AD6000000014E434A000E043D9EE88D387FDB00BF7AAF030E05BB0C1E30BB572E68BBAA24AE"
        "0E07BC8AAC80BC72C50EBCC4E2C10E083EEE3D9FBD66DADDC0AFDEF59196"
    )
    sample = only(microstrain.MipParser(), data)
    assert sample.time == 23067000000
    assert sample.values[:3] == pytest.approx((-0.002138, -0.003283, -0.005192), abs=5e-7)
    in_g = [a / 9.80665 for a in sample.values[3:]]
    assert in_g == pytest.approx((0.077592, 0.000061, -0.979233), abs=5e-7)
    found = microstrain.fields(data[4:-2])
    assert microstrain.packet(0x80, *[microstrain.field(d, body) for d, body in found]) == data


def test_microstrain_round_trip():
    rate, force = (0.5, -0.25, 2.0), (0.0, 9.80665, -19.6133)
    sample = only(microstrain.MipParser(), microstrain.encode(123_456_789_000, rate, force))
    assert sample.values == pytest.approx(rate + force, abs=1e-15)
    assert sample.time == 123_456_789_000


def test_vectornav_round_trip_and_crc():
    rate, force = (0.5, -0.25, 2.0), (0.125, 9.75, -1.0)
    data = vectornav.encode(5_000_000, rate, force)
    assert vectornav.crc_hqx(data[1:], 0) == 0
    sample = only(vectornav.VectorNavParser(), data)
    assert (sample.values, sample.time) == (rate + force, 5_000_000)


def test_vectornav_reads_another_layout_of_its_group():
    mask = 0b1_0011_1001  # time, attitude, quaternion, rate, acceleration
    body = struct.pack("<BHQ3f4f3f3f", 1, mask, 9, *[0.0] * 7, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    data = b"\xfa" + body + vectornav.crc_hqx(body, 0).to_bytes(2, "big")
    assert only(create_device("vectornav", mask=mask).parser(), data).values == (1, 2, 3, 4, 5, 6)


def test_vectornav_ascii_vector():
    text = (
        "VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
        "-00.000018,+00.001122,-00.000551"
    )
    data = b"$" + text.encode() + b"*69\r\n"
    assert vectornav.sentence(text) == data
    sample = only(vectornav_ascii.VectorNavAsciiParser(), data)
    assert sample.values == (-0.000018, 0.001122, -0.000551, -1.258, -0.1, -9.701)
    again = vectornav_ascii.encode(sample.values[:3], sample.values[3:])
    assert only(vectornav_ascii.VectorNavAsciiParser(), again).values == sample.values


def line(**options):
    columns = ["time us", "_", "omega_x deg/s", "omega_y deg/s", "omega_z deg/s"]
    columns += ["specific_force_x g", "specific_force_y g", "specific_force_z g"]
    return create_device("line", columns=columns, separator=",", whole_lines=True, **options)


def test_a_line_of_numbers_in_its_units():
    device = line()
    assert device.measures == "imu"
    sample = only(device.parser(), b"1500, 7, 180, 0, -90, 0.5, 0, 1e0\n")
    assert sample.time == 1_500_000
    assert sample.values == pytest.approx((3.141592653589793, 0, -1.5707963267948966, 4.903325, 0, 9.80665))


def test_a_bad_line_is_no_sample_and_nothing_inside_it_is():
    parser = line().parser()
    good = b"1,2,3,4,5,6,7,8\n"
    samples = parser.feed(good + b"x1,2,3,4,5,6,7,8\n\n1,2,3\n1e308,2,3,4,5,6,7,8\n" + b"1," * 400 + b"\n" + good)
    assert len(samples) == 2
    assert parser.counts.skipped == 17 + 1 + 6 + 20 + 801
    assert (parser.counts.failures, parser.counts.resynchronisations) == (1, 1)


def test_the_first_half_line_is_passed_over():
    parser = create_device("line", columns=["a", "b"]).parser()
    assert [s.values for s in parser.feed(b"5 6\n7 8\n")] == [(7.0, 8.0)]


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("bota2", {}, "unknown kind .*choose ati-net-ft, bota"),
        ("bota", {"speed": 3}, "unknown option 'speed'.*rate, configure"),
        ("bota", {"rate": "fast"}, "give a number"),
        ("bota", {"rate": True}, "give a number"),
        ("bota", {"rate": 0}, "'rate' .* out of range: give a number from 0.1 to 50000 Hz"),
        ("vectornav", {"rate": float("nan")}, "out of range"),
        ("line", {"columns": ["a"], "rate": float("inf")}, "out of range"),
        ("robotous", {"rate": 123}, "choose one of 200"),
        ("vectornav", {"mask": 1}, "needs bits 5"),
        ("line", {}, "'columns' .* missing"),
        ("line", {"columns": ["a furlong"]}, "unknown unit"),
        ("line", {"columns": ["a", "a"]}, "twice"),
    ],
)
def test_wrong_options_say_what_to_do(kind, options, words):
    with pytest.raises(RigError, match=words):
        create_device(kind, **options)


def talk(conversation, emulator, *, silent=False, boots=True):
    """Let a device's conversation talk with its emulator, which streams while it may; returns the identity."""
    index, answer = 0, None
    heard = [emulator.boot() if boots else b""]
    try:
        request = conversation.send(None)
        while True:
            if isinstance(request, Send):
                heard.append(b"" if silent else emulator.receive(request.data))
                answer = None
            elif isinstance(request, Inquire):
                answer = (b"" if silent else emulator.inquired(*request), 0.0)
            else:
                assert isinstance(request, Listen)
                if emulator.streaming and not silent:
                    index += 1
                    heard.append(emulator.frame(index, index / emulator.rate, (0.0,) * 6))
                answer = (b"" if silent else b"".join(heard), request.seconds)
                heard = []
            request = conversation.send(answer)
    except StopIteration as stop:
        return stop.value


KINDS_THAT_TALK = [kind for kind in kinds() if kind != "line"]
RATES = {
    "robotous": 200.0,
    "vectornav": 200.0,
    "vectornav-ascii": 100.0,
    "bota": 800.0,
    "robotiq-ft": 100.0,
    "ur-rtde": 500.0,
}
ONE_RATE = {"robotiq-ft"}
SET_ELSEWHERE = {"ati-net-ft"}  # its rate, on its own page
RESOLUTION = {
    "ati-net-ft": 5.1e-7,
    "robotous": 0.0101,
    "robotiq-ft": 0.0051,
    "microstrain": 2e-7,
}  # half a step; f32 of a g


@pytest.mark.parametrize("kind", KINDS_THAT_TALK)
def test_the_conversation_identifies_configures_and_starts(kind):
    rate = RATES.get(kind, 250.0)
    device = create_device(kind, **({} if kind in ONE_RATE else {"rate": rate}))
    emulator = device.emulator(rate=rate if kind in SET_ELSEWHERE else 1.0)
    identity = talk(device.start(), emulator)
    assert emulator.streaming
    assert emulator.rate == pytest.approx(rate)
    assert all([identity.model, identity.serial, identity.firmware, identity.settings])
    assert identity.warnings == ()
    values = tuple(0.125 * i - 1 for i in range(sum(len(channel.signals) for channel in device.channels)))
    (sample,) = device.parser().feed(emulator.frame(5, 0.005, values))
    assert sample.values == pytest.approx(values, abs=RESOLUTION.get(kind, 1e-12))
    emulator.receive(device.stop())
    assert not emulator.streaming


def test_a_sensor_that_was_running_already_is_named_by_nobody():
    """It answers the commands but shows no boot text: that is said, and no name is made up."""
    device = create_device("bota", rate=800.0)
    emulator = device.emulator(rate=800.0)
    identity = talk(device.start(), emulator, boots=False)
    assert emulator.streaming
    assert identity.model == identity.serial == ""
    assert "did not boot when its port was opened" in identity.warnings[0]


@pytest.mark.parametrize("kind", KINDS_THAT_TALK)
def test_a_silent_device_is_no_answer(kind):
    device = create_device(kind)
    with pytest.raises(NoAnswerError) as error:
        talk(device.start(), device.emulator(rate=1.0), silent=True)
    assert error.value.heard == 0


@pytest.mark.parametrize("kind", [kind for kind in KINDS_THAT_TALK if kind != "ur-rtde"])  # it only comes when asked
def test_a_device_that_must_not_be_configured_is_sent_nothing(kind):
    counts = {"counts_per_force": 1e6, "counts_per_torque": 1e6} if kind == "ati-net-ft" else {}
    device = create_device(kind, configure=False, **counts)
    with pytest.raises(StopIteration):
        device.start().send(None)
    assert device.stop() == b""


def test_every_kind_is_a_device():
    options = {"line": {"columns": ["force.x"]}}
    assert all(isinstance(create_device(kind, **options.get(kind, {})), Device) for kind in kinds())
