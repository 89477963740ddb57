"""A robot arm in MuJoCo swings a payload: joint states, a URDF and a wrist sensor give the payload's tensor.

MuJoCo computes the wrist's force and moment from its own description of the arm; how the wrist turns is computed from a
URDF of the same arm.
"""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from identify.signals.run import RunError
from rig.bags.topics import GrowingColumn, TopicMessages
from rig.exceptions import RigError
from tests.helpers.bags import STORE, header, wrench, write_rosbag2
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load, load_run

AXES = ["0 0 1", "0 1 0", "0 0 1", "0 -1 0", "0 0 1", "0 1 0", "0 0 1"]
OFFSETS = ["0 0 0.33", "0 0 0.10", "0 0 0.20", "0.08 0 0.10", "-0.08 0 0.30", "0.02 0 0.05", "0.09 0 0.10"]
FLANGE, TURN = "0.01 -0.02 0.11", "0.3 -0.2 0.5"  # roll, pitch, yaw about fixed axes
MASS, R_CG = 2.3, np.array([0.012, -0.021, 0.063])
TENSOR = np.array([[0.021, 0.0013, -0.0021], [0.0013, 0.017, 0.0009], [-0.0021, 0.0009, 0.011]])
RATE, SECONDS = 500.0, 8.0
NAMES = [f"arm_{k}" for k in range(1, 8)]


def mjcf():
    payload = " ".join(map(str, [*TENSOR.diagonal(), TENSOR[0, 1], TENSOR[0, 2], TENSOR[1, 2]]))
    inner = (
        f'<body name="payload" pos="{FLANGE}" euler="{TURN}"><site name="wrist"/><inertial mass="{MASS}" '
        f'pos="{" ".join(map(str, R_CG))}" fullinertia="{payload}"/></body>'
    )
    for name, axis, offset in reversed(list(zip(NAMES, AXES, OFFSETS, strict=True))):
        link = '<inertial mass="1.5" pos="0 0 0.05" diaginertia="0.01 0.01 0.01"/>'
        inner = f'<body pos="{offset}"><joint name="{name}" axis="{axis}"/>{link}{inner}</body>'
    return (
        '<mujoco><option gravity="0 0 -9.81" integrator="RK4"/><compiler angle="radian" eulerseq="XYZ"/>'
        f'<worldbody>{inner}</worldbody><sensor><force site="wrist"/><torque site="wrist"/>'
        '<accelerometer site="wrist"/></sensor></mujoco>'
    )


def urdf(kinds=None):
    """The same arm; ``kinds`` names joints that are continuous instead of revolute."""
    links = ['<link name="base"/>']
    for k, (name, axis, offset) in enumerate(zip(NAMES, AXES, OFFSETS, strict=True), start=1):
        parent = "base" if k == 1 else f"link_{k - 1}"
        kind = (kinds or {}).get(name, "revolute")
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>' if kind == "revolute" else ""
        links.append(
            f'<link name="link_{k}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="link_{k}"/><origin xyz="{offset}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
    links.append(
        f'<link name="tool"/><joint name="flange" type="fixed"><parent link="link_7"/><child link="tool"/>'
        f'<origin xyz="{FLANGE}" rpy="{TURN}"/></joint>'
    )
    return f'<robot name="arm">{"".join(links)}</robot>'


@pytest.fixture(scope="module")
def swing():
    """Time, joints' positions and velocities; force and moment on the payload, and specific force, at the wrist."""
    model = mujoco.MjModel.from_xml_string(mjcf())
    data = mujoco.MjData(model)
    t = np.arange(round(RATE * SECONDS)) / RATE
    speed = 2 * np.pi * np.array([0.4, 0.55, 0.7, 0.5, 0.9, 0.8, 1.0])
    size = np.array([0.5, 0.4, 0.5, 0.5, 0.6, 0.6, 0.8])
    phase = np.multiply.outer(t, speed) + np.arange(7)
    q, v, a = size * np.sin(phase), size * speed * np.cos(phase), -size * speed**2 * np.sin(phase)
    readings = []
    for one in zip(q, v, a, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = one
        mujoco.mj_inverse(model, data)
        readings.append(data.sensordata.copy())
    return t, q, v, np.array(readings)


def write(path, swing, *, velocities=True, noise=0.0, names=NAMES):
    t, q, v, readings = swing
    kind, draw, items = "sensor_msgs/msg/JointState", np.random.default_rng(7), []
    finger = np.zeros((len(t), 1))
    q, v = np.hstack([finger, q + noise * draw.normal(size=q.shape)]), np.hstack([finger, v])
    for k in range(len(t)):
        time = 10**9 + round(t[k] * 1e9)
        velocity = v[k] if velocities else np.zeros(0)
        joints = STORE.types[kind](header(STORE, time, ""), ["finger", *names], q[k], velocity, np.zeros(0))
        name = "geometry_msgs/msg/WrenchStamped"
        stamped = STORE.types[name](header(STORE, time, "wrist"), wrench(STORE, readings[k, :3], readings[k, 3:6]))
        items += [(time, "/joint_states", kind, joints), (time, "/wrist", name, stamped)]
    write_rosbag2(path, items)
    return path


UNKNOWN = '[[source]]\nname = "r"\ntarget = "r_cg"\nkind = "bias"\nsigma = ["0.1 m", "0.1 m", "0.1 m"]\ngroup = "cg"\n'


def experiment(folder, text=None, r_cg=R_CG, sources="", **declared):
    text = urdf() if text is None else text
    (folder / "arm.urdf").write_bytes(text if isinstance(text, bytes) else text.encode())
    keys = {"urdf": "arm.urdf", "urdf_frame": "tool", "wrench": "on_body"} | declared
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items() if value is not None)
    (folder / "e.toml").write_text(
        f'[body]\nr_cg_from_q = ["{r_cg[0]} m", "{r_cg[1]} m", "{r_cg[2]} m"]\n{sources}'
        f'[[estimator]]\nname = "s"\ndifferentiator = "savitzky-golay"\nband = "6 Hz"\n[recording]\n{lines}'
    )
    return Experiment.load(folder / "e.toml")


@pytest.mark.parametrize(
    ("velocities", "kind"),
    [(True, "revolute"), (False, "revolute"), pytest.param(True, "continuous", marks=pytest.mark.slow)],
)
def test_the_payloads_tensor(tmp_path, swing, velocities, kind):
    path = write(tmp_path / "bag", swing, velocities=velocities)
    declared = experiment(tmp_path, urdf({"arm_3": kind, "arm_7": kind}))
    if kind == "continuous":  # the band is found where no estimator is declared
        declared = replace(declared, estimators=())
    result = identify_files([path], declared)
    expected = TENSOR[np.triu_indices(3)]
    np.testing.assert_allclose(result.inertia[[0, 3, 5]], expected[[0, 3, 5]], rtol=1e-3)
    np.testing.assert_allclose(result.inertia, expected, atol=1e-3 * expected[5])
    said = " ".join(result.assumptions)
    assert "base of the robot rests" in said
    assert ("velocities in /joint_states is white" in said) == velocities
    assert "nothing judges its sign, units, axes and weight without recording.urdf_gravity" in said


def test_encoders_with_noise_are_within_a_percent_and_their_bias_is_stated(tmp_path, swing):
    """20 µrad of noise on every joint, positions alone: the moments within 1 %."""
    result = identify_files([write(tmp_path / "bag", swing, velocities=False, noise=2e-5)], experiment(tmp_path))
    moments = TENSOR.diagonal()
    np.testing.assert_allclose(result.inertia[[0, 3, 5]], moments, rtol=0.01)
    off = np.abs(result.inertia[[0, 3, 5]] - moments - result.bias[[0, 3, 5]])
    assert (off < 4 * result.standard_uncertainty[[0, 3, 5]] + 2e-4 * moments).all()


GRAVITY = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]


@pytest.mark.parametrize(("velocities", "kind"), [(True, "revolute"), (False, "continuous")])
def test_the_specific_force_of_the_joints_is_that_of_an_accelerometer(tmp_path, swing, velocities, kind):
    """MuJoCo's; the differentiator passes 6 Hz within 1e-3, twice."""
    path = write(tmp_path / "bag", swing, velocities=velocities)
    recording = experiment(tmp_path, urdf({"arm_3": kind}), urdf_gravity=GRAVITY).recording
    recorded = load(path, recording, band=6.0)
    run = recorded.run
    assert run.specific_force is not None
    expected = swing[3][np.round(run.t * RATE).astype(int), 6:]
    assert len(expected) > 3500
    np.testing.assert_allclose(run.specific_force, expected, atol=0.01)
    assert "with gravity of 9.81 m/s²" in " ".join(recorded.assumptions)


@pytest.mark.usefixtures("unjudged")
def test_joints_and_wrench_tell_ten_parameters(tmp_path, swing):
    """Without an IMU; the centre of gravity is declared 20 mm off, and hardly."""
    exact = {"sigma_delay": "0 s", "sigma_rotation": "0 deg", "sigma_gyro_bias": "0 rad/s"}
    exact |= {"sigma_accelerometer_bias": "0 m/s^2"}
    declared = experiment(tmp_path, None, R_CG + 0.02, UNKNOWN, urdf_gravity=GRAVITY, **exact)
    result = identify_files([write(tmp_path / "bag", swing, noise=2e-6)], declared, method="joint")
    np.testing.assert_allclose(result.mass, MASS, rtol=1e-3)
    np.testing.assert_allclose(result.r_cg, R_CG, atol=5e-5)
    expected = TENSOR[np.triu_indices(3)]
    np.testing.assert_allclose(result.inertia, expected, atol=3e-3 * expected[5])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q, v: (np.degrees(q), np.degrees(v)), "joint 'arm_1' of .* goes from .* record positions in rad"),
        (lambda q, v: (q, np.degrees(v)), "velocities of .* are 57.3 times the rate of its positions"),
        (lambda q, v: (q, v * [1, 1, 1, 1, 1, -1, 1]), "velocities of .* the rate"),
    ],
)
def test_units_that_contradict_the_robot(tmp_path, swing, change, words):
    t, q, v, readings = (part[:1000] for part in swing)
    path = write(tmp_path / "bag", (t, *change(q, v), readings))
    with pytest.raises(RunError, match=words):
        load_run(path, experiment(tmp_path).recording)


@pytest.mark.parametrize(
    ("declared", "text", "words"),
    [
        ({"urdf": None, "urdf_frame": None}, None, "declare the robot by recording.urdf and recording.urdf_frame"),
        ({"urdf_frame": None}, None, "declare the robot by recording.urdf"),
        ({"urdf": "gone.urdf"}, None, "no file .*gone.urdf at recording.urdf"),
        ({"urdf_frame": "hand"}, None, "unknown frame 'hand' at recording.urdf_frame: .*link_1"),
        ({}, "<robot", "no URDF .*arm.urdf"),
        ({}, "hello", "no URDF .*arm.urdf"),
        ({}, urdf().replace("<link", '<xacro:property name="a" value="1"/><link', 1), "run `xacro"),
        ({}, urdf().replace(FLANGE, "0 ${a} 0"), "xacro macros in arm.urdf"),
        ({}, urdf().replace(FLANGE, "0 nan 0"), "no URDF .*arm.urdf"),
        ({}, urdf().replace('axis xyz="0 1 0"', 'axis xyz="0 0 0"'), "no direction in the axis of joint 'arm_2'"),
        ({}, urdf().replace('axis xyz="0 -1 0"', 'axis xyz="0 1e308 0"'), "no direction in the axis of joint 'arm_4'"),
        ({}, urdf().replace("arm_1", "arm\N{DEGREE SIGN}").encode("latin-1"), "no URDF .*arm.urdf"),
        ({"angular_velocity_unit": "deg/s"}, None, "remove recording.angular_velocity_unit"),
        ({"acceleration_unit": "g"}, None, "remove recording.acceleration_unit"),
    ],
)
def test_a_robot_that_cannot_be_used(tmp_path, swing, declared, text, words, capfd):
    path = write(tmp_path / "bag", tuple(part[:100] for part in swing))
    spec = experiment(tmp_path, text, **declared)
    with pytest.raises((ExperimentError, RunError, RigError), match=words) as error:
        load_run(path, spec.recording)
    assert "\n" not in str(error.value)
    assert not capfd.readouterr().err


def test_an_unknown_joint_is_named(tmp_path, swing):
    path = write(tmp_path / "bag", tuple(part[:100] for part in swing), names=["elbow", *NAMES[1:]])
    with pytest.raises(
        RunError, match=r"joint 'arm_1' of arm.urdf is not in /joint_states in bag: it has finger, elbow"
    ):
        load_run(path, experiment(tmp_path).recording)


def publish(path, swing, *publishers):
    """Joint states of several publishers: their joints' names, positions, velocities (or None) and delay [ns]."""
    t, _, _, readings = swing
    kind, name, items = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped", []
    for k in range(len(t)):
        time = 10**9 + round(t[k] * 1e9)
        for number, (names, q, v, delay) in enumerate(publishers):
            velocity = np.zeros(0) if v is None else v[k]
            head = header(STORE, time + delay, f"frame_{number}")
            items += [
                (time + delay, "/joint_states", kind, STORE.types[kind](head, names, q[k], velocity, np.zeros(0)))
            ]
        stamped = STORE.types[name](header(STORE, time, "wrist"), wrench(STORE, readings[k, :3], readings[k, 3:6]))
        items.append((time, "/wrist", name, stamped))
    write_rosbag2(path, sorted(items, key=lambda item: item[0]))
    return path


def published(q, v, case):
    """Publishers of the same motion, as robots have them."""
    finger = ["finger"], np.zeros((len(q), 1)), None, 300_000
    split = (NAMES[:3], q[:, :3], None, 0), (NAMES[3:], q[:, 3:], None, 100_000)
    missing = np.where(np.arange(len(q))[:, None] == 40, np.nan, q)
    return {
        "nan velocities": ((NAMES, q, np.full_like(v, np.nan), 0),),
        "zero velocities": ((NAMES, q, np.zeros_like(v), 0),),
        "wrapped": ((NAMES, (q + 3 + np.pi) % (2 * np.pi) - np.pi - 3, None, 0),),
        "gripper": ((NAMES, q, None, 0), finger),
        "two halves": split,
        "prefix": (([f"left/{name}" for name in NAMES], q, None, 0), finger),
        "one NaN": ((NAMES, missing, None, 0),),
    }[case]


@pytest.mark.parametrize("gravity", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("case", "note"),
    [
        ("nan velocities", ""), ("zero velocities", ""), ("wrapped", "the jumps of joint 'arm_7' by a turn"),
        ("gripper", "1,000 messages of /joint_states without all its joints"), ("two halves", ""),
        ("prefix", "without the recorded prefix 'left/'"), ("one NaN", "1 message of /joint_states"),
    ],
)  # fmt: skip
def test_joints_as_robots_publish_them(tmp_path, swing, case, note, gravity):
    part = tuple(signal[:1000] for signal in swing)
    _, q, v, _ = part
    keys = {"urdf_gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]} if gravity else {}
    declared = experiment(tmp_path, **keys).recording
    plain = load(publish(tmp_path / "plain", part, (NAMES, q, None, 0)), declared, band=6.0).run
    path = publish(tmp_path / "bag", part, *published(q, v, case))
    got = load(path, declared, band=6.0)
    assert note in " ".join(got.assumptions)
    at = np.linspace(0.3, 1.7, 50)  # inside both
    for signal in ("omega", "specific_force")[: 1 + gravity]:
        expected, values = getattr(plain, signal), getattr(got.run, signal)
        for k in range(3):
            reached = np.interp(at, got.run.t, values[:, k])
            np.testing.assert_allclose(reached, np.interp(at, plain.t, expected[:, k]), atol=0.01)


def test_a_revolute_joint_without_limits_is_read(tmp_path, swing):
    text = urdf().replace('<limit lower="-3" upper="3" effort="1" velocity="1"/>', "")
    path = write(tmp_path / "bag", tuple(part[:500] for part in swing), velocities=False)
    limited, free = (load(path, experiment(tmp_path, robot).recording, band=6.0).run for robot in (None, text))
    np.testing.assert_array_equal(free.omega, limited.omega)


def test_a_position_beyond_any_sensor_is_one_line(tmp_path, swing):
    """Of a joint that no limit refuses."""
    text = urdf().replace('<limit lower="-3" upper="3" effort="1" velocity="1"/>', "")
    t, q, v, readings = (part[:200].copy() for part in swing)
    q[50, 6] = 1e200
    path = write(tmp_path / "bag", (t, q, v, readings), velocities=False)
    with pytest.raises(RunError, match=r"position of /joint_states in bag is 1.0e\+200 at sample 50: no sensor reads"):
        load(path, experiment(tmp_path, text).recording, band=6.0)


def test_messages_that_lack_velocities_others_have_are_one_line():
    messages = TopicMessages("sensor_msgs/msg/JointState")
    for names, width in ((NAMES, 0), (NAMES[:6], 6)):
        columns = {"log_time": np.arange(2), "position": np.zeros((2, len(names))), "velocity": np.zeros((2, width))}
        for name, values in columns.items():
            messages.columns.setdefault(tuple(names), {}).setdefault(name, GrowingColumn(values)).extend(values)
    with pytest.raises(RigError, match="lack values that others have: split the run"):
        messages.arrays()
