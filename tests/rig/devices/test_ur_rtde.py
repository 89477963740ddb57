"""Universal Robots RTDE against packages made by hand from its guide, and SciPy's rotations."""

import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rig.devices import create_device, ur_rtde
from rig.devices.conversation import Inquire, NoAnswerError, Send
from rig.exceptions import RigError
from tests.helpers.rig_samples import only

JOINTS = 12


def robot(**options):
    return create_device("ur-rtde", **{"values": ["actual_tool_accelerometer"]} | options)


def hand_made(time, wrench, joints, accelerometer, pose=()):
    """A data package, field by field."""
    numbers = [time, *wrench, *joints, *accelerometer, *pose]
    content = b"U" + b"\x01" + b"".join(struct.pack(">d", number) for number in numbers)
    return struct.pack(">H", len(content) + 2) + content


def test_a_data_package_made_by_hand():
    device = robot()
    wrench, joints, accelerometer = range(1, 7), [0.1 * i for i in range(JOINTS)], (0.0, 0.0, 9.81)
    data = hand_made(1234.568, wrench, joints, accelerometer)
    assert data[:12].hex() == "00b4 55 01 40934a45a1cac083".replace(" ", "")
    sample = only(device.parser(), data)
    assert sample.values == (*wrench, *joints, *accelerometer)
    assert sample.time == 1_234_568_000_000
    assert [channel.measures for channel in device.channels] == ["wrench", "joints", "values"]
    assert device.channels[1].names[0] == "shoulder_pan_joint"
    assert device.channels[2].names == tuple(f"actual_tool_accelerometer_{i}" for i in range(3))


def test_a_package_that_the_robot_left_out_is_missing():
    parser = robot(rate=500.0).parser()
    for k in (0, 1, 2, 5, 6):
        parser.feed(hand_made(10 + 0.002 * k, [0] * 6, [0] * JOINTS, [0] * 3))
    assert (parser.counts.samples, parser.counts.missing) == (5, 2)


def test_text_between_the_data_is_passed_over():
    parser = robot().parser()
    text = b"M" + bytes([5]) + b"hello" + bytes([3]) + b"rob" + b"\x03"
    data = hand_made(1.0, [0] * 6, [0] * JOINTS, [0] * 3)
    parser.feed(data + struct.pack(">H", len(text) + 2) + text + data)
    counts = parser.counts
    assert (counts.frames, counts.samples, counts.skipped, counts.resynchronisations) == (3, 2, 0, 0)


@pytest.mark.parametrize("vector", [(0.0, 0.0, 0.0), (0.3, -1.2, 2.0), (0.0, 0.0, np.pi), (1e-12, 0.0, 0.0)])
def test_a_wrench_along_the_base_is_turned_to_the_tool(vector):
    """The pose is that of the tool in the base, so its inverse turns the wrench."""
    device = robot(wrench_frame="base", wrench_variable="actual_TCP_force")
    force, moment = np.array([1.0, -2.0, 9.0]), np.array([0.1, 0.2, -0.3])
    joints, accelerometer = [0.5] * JOINTS, (0.1, 0.2, 9.8)
    sample = only(device.parser(), hand_made(2.0, [*force, *moment], joints, accelerometer, (7, 8, 9, *vector)))
    back = Rotation.from_rotvec(vector).inv()
    np.testing.assert_allclose(sample.values[:3], back.apply(force), atol=1e-12)
    np.testing.assert_allclose(sample.values[3:6], back.apply(moment), atol=1e-12)
    assert sample.values[6:] == (*joints, *accelerometer)
    assert device.outputs[-1] == "actual_TCP_pose"


@pytest.mark.parametrize("angle", [np.inf, np.nan, 1e300])
def test_a_pose_that_is_none_gives_no_sample(angle):
    parser = robot(wrench_frame="base").parser()
    package = hand_made(2.0, [np.inf] * 6, [0.5] * JOINTS, (0.1, 0.2, 9.8), (7, 8, 9, angle, 0, 0))
    assert parser.feed(package) == []
    assert parser.counts.frames == 1


def test_the_emulated_robot_turns_its_wrench_as_the_parser_undoes():
    device = robot(wrench_frame="base")
    values = tuple(0.25 * i for i in range(device.width))
    for time in (0.0, 1.0, 2.5):
        frame = device.emulator(rate=500.0).frame(0, time, values)
        assert only(device.parser(), frame).values == pytest.approx(values, abs=1e-12)
    plain = np.array(only(robot().parser(), robot().emulator(rate=1.0).frame(0, 1.0, values)).values)
    base = struct.unpack_from(">6d", frame, 12)
    assert np.linalg.norm(base[:3]) == pytest.approx(np.linalg.norm(plain[:3]))
    assert not np.allclose(base[:3], plain[:3], atol=0.01)


def answers(changed=()):
    """What a robot answers, byte by byte."""
    types = "DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR3D"
    return {
        "V": bytes.fromhex("0004 56 01"),
        "v": bytes.fromhex("0013 76 00000005 0000000b 00000002 00000065"),
        "O": struct.pack(">HBB", 4 + len(types), ord("O"), 7) + types.encode(),
        "S": bytes.fromhex("0004 53 01"),
    } | dict(changed)


def converse(device, said, dashboard=b""):
    conversation, answer, heard = device.start(), None, b""
    sent = []
    try:
        while True:
            request = conversation.send(answer)
            if isinstance(request, Inquire):
                answer = dashboard, 0.0
            elif isinstance(request, Send):
                sent.append(request.data)
                heard, answer = said.get(chr(request.data[2]), b""), None
            else:
                (answer, heard) = (heard, request.seconds), b""
    except StopIteration as stop:
        return stop.value, sent


def test_the_negotiation_byte_by_byte():
    device = robot(rate=125.0, wrench_variable="ft_raw_wrench")
    dashboard = b"Connected: Universal Robots Dashboard Server\nUR5\n20175599999\nDisconnected\n"
    identity, sent = converse(device, answers(), dashboard)
    names = b"timestamp,ft_raw_wrench,actual_q,actual_qd,actual_tool_accelerometer"
    assert sent == [
        bytes.fromhex("0005 56 0002"),
        bytes.fromhex("0003 76"),
        struct.pack(">HBd", 11 + len(names), ord("O"), 125.0) + names,
        bytes.fromhex("0003 53"),
    ]
    assert (identity.model, identity.serial, identity.firmware) == ("UR5", "20175599999", "5.11.2.101")
    assert device.stop() == bytes.fromhex("0003 50")
    data = bytearray(hand_made(1.0, [0] * 6, [0] * JOINTS, [0] * 3))
    data[3] = 7  # the recipe that the robot gave
    assert only(device.parser(), bytes(data)).time == 10**9


UNKNOWN = b"\1DOUBLE,NOT_FOUND,VECTOR6D,VECTOR6D,VECTOR3D"
OTHER = b"\1DOUBLE,VECTOR6D,VECTOR6D,VECTOR6INT32,VECTOR3D"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"V": bytes.fromhex("0004 56 00")}, "does not speak version 2"),
        ({"O": ur_rtde.package(79, UNKNOWN)}, "no output actual_TCP_force: choose others"),
        ({"O": ur_rtde.package(79, OTHER)}, "VECTOR6INT32"),
        ({"S": bytes.fromhex("0004 53 00")}, "does not start its data"),
        ({"v": bytes.fromhex("0013 76 00000003 0000000f 00000007 00000065")}, "software 3 sends at most 125 Hz"),
    ],
)
def test_what_the_robot_refuses_is_one_line(changed, words):
    with pytest.raises(RigError, match=words):
        converse(robot(), answers(changed))


@pytest.mark.parametrize(
    ("declared", "doubts"),
    [
        (("actual_TCP_force", "base", "gravity"), []),
        (("ft_raw_wrench", "sensor", "none"), []),
        (("actual_TCP_force", "sensor", "none"), ["wrench_frame of actual_TCP_force is 'base'", "compensated of"]),
        (("ft_raw_wrench", "base", "none"), ["wrench_frame of ft_raw_wrench is 'sensor'"]),
    ],
)
def test_a_declaration_against_the_makers_documents_is_a_warning(declared, doubts):
    name, frame, compensated = declared
    device = robot(wrench_variable=name, wrench_frame=frame, compensated=compensated)
    types = ",".join(ur_rtde.TYPES[ur_rtde.WIDTH[output]] for output in device.outputs).encode()
    identity, _ = converse(device, answers({"O": ur_rtde.package(79, b"\1" + types)}))
    assert len(identity.warnings) == len(doubts)
    assert all(text.startswith(doubt) for text, doubt in zip(identity.warnings, doubts, strict=True))


def test_another_service_at_the_address_is_no_robot():
    with pytest.raises(NoAnswerError) as error:
        converse(robot(), {"V": b"SSH-2.0-OpenSSH_9.6\r\n"})
    assert error.value.heard == 3 * 21


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"wrench_variable": "force"}, "choose ft_raw_wrench or actual_TCP_force"),
        ({"values": ["safety_mode"]}, "names 'safety_mode': choose from"),
        ({"rate": 1000.0}, "from 1 to 500 Hz"),
    ],
)
def test_wrong_options_say_what_to_do(options, words):
    with pytest.raises(RigError, match=words):
        robot(**options)
