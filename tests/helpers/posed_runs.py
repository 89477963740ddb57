"""A payload on a simulated arm, recorded in whatever convention: joints, poses, an IMU with or without a quaternion.

Kinematics in closed form and plain NumPy and SciPy, which share no code with the product. How often clean recordings
are suspected:

    python -m tests.helpers.posed_runs               # five minutes of processor time
    python -m tests.helpers.posed_runs --runs 3 --identify
"""

import argparse
import json
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from tests.helpers.bags import ROS1, STORE, header, vector, wrench, write_ros1, write_rosbag2

G, STEP = 9.81, 1e-3
UP = np.array([0.0, 0.0, G])
MASS, R_CG = 2.0, np.array([0.02, -0.03, 0.048])
TENSOR = 1e-3 * np.array([[9.0, 1.2, -0.8], [1.2, 7.0, 1.5], [-0.8, 1.5, 5.0]])
ZERO = np.array([2.0, -1.0, 3.0, 0.1, -0.05, 0.02])
AXES, LINKS = "zyyxyx", [(0, 0, 0.3), (0, 0, 0.2), (0.4, 0, 0), (0.3, 0, 0.05), (0.05, 0, 0), (0.1, 0, 0.02)]
NAMES = [f"joint_{k}" for k in range(1, 7)]
BAND = 3.0
"""Highest frequency of the motion [Hz]."""
EASE = 2.0
"""Seconds in which the arm begins to move, and comes to rest."""
START = 1_750_000_000_000_000_000
NOISE = {"force": 0.05, "moment": 2e-3, "gyro": 1e-3, "accelerometer": 0.02, "joint": 1e-5, "place": 1e-5}


@dataclass(frozen=True)
class PosedRun:
    """Signals at common instants: wrench on the body at Q in B, motion of B, whose origin is Q; SI units."""

    t: np.ndarray
    joints: np.ndarray
    attitude: Rotation
    omega: np.ndarray
    acceleration: np.ndarray
    """Of Q, in B, without gravity."""
    force: np.ndarray
    moment: np.ndarray
    quaternion: np.ndarray
    place: np.ndarray
    """Of Q, along the axes at rest."""
    specific_force: np.ndarray
    wrench_late: float = 0.0
    """Time by which the wrench's stamps are late [s]; the log's times are right."""
    orders: int = 1
    """Number of orders in which messages name the joints, at random."""
    arrives: np.ndarray | None = None
    """Instants at which the wrench's messages arrive, and are stamped [s]; None: as they were measured."""


def urdf(path):
    """The arm's description, whose link ``tool`` turns with the body."""
    parts = ['<link name="root"/>']
    for k, (axis, offset) in enumerate(zip(AXES, LINKS, strict=True)):
        parent, child = ("root" if k == 0 else f"link_{k}"), ("tool" if k == 5 else f"link_{k + 1}")
        unit = " ".join("1" if axis == name else "0" for name in "xyz")
        parts.append(
            f'<link name="{child}"/><joint name="{NAMES[k]}" type="revolute"><parent link="{parent}"/><child '
            f'link="{child}"/><origin xyz="{" ".join(map(str, offset))}"/><axis xyz="{unit}"/>'
            '<limit lower="-6" upper="6" effort="1" velocity="9"/></joint>'
        )
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return path


def _angles(t, seed, seconds):
    draw = np.random.default_rng([seed, 1])
    frequency, phase = draw.uniform(0.1, 0.35, (2, 6)), draw.uniform(0, 2 * np.pi, (2, 6))
    size = np.array([[0.5], [0.35]]) * [1.2, 1.0, 1.0, 1.6, 1.4, 2.0]
    moving = sum(size[k] * np.sin(2 * np.pi * np.multiply.outer(t, frequency[k]) + phase[k]) for k in range(2))
    start, stop = np.clip(t / EASE, 0, 1), np.clip((seconds - t) / EASE, 0, 1)
    return ((start * stop) ** 4 * (35 + (start * stop) * (-84 + (start * stop) * (70 - 20 * start * stop))))[
        :, None
    ] * moving


def _place(t, seed, seconds):
    """Attitude and position of the tool."""
    angles, turn, at = _angles(t, seed, seconds), Rotation.identity(len(t)), np.zeros((len(t), 3))
    for k, (axis, offset) in enumerate(zip(AXES, LINKS, strict=True)):
        at = at + turn.apply(offset)
        turn = turn * Rotation.from_euler(axis, angles[:, [k]])
    return turn, at


def _omega(t, seed, seconds):
    before, after = _place(t - STEP, seed, seconds)[0], _place(t + STEP, seed, seconds)[0]
    return (before.inv() * after).as_rotvec() / (2 * STEP)


def measured(seed=0, *, seconds=12.0, rate=100.0, noise=1.0):
    """A run without any error but noise and the load cell's zero."""
    t, draw = np.arange(0, seconds, 1 / rate), np.random.default_rng(seed).normal
    (attitude, here), ahead, behind = (
        _place(t, seed, seconds),
        _place(t + STEP, seed, seconds)[1],
        _place(t - STEP, seed, seconds)[1],
    )
    omega, alpha = (
        _omega(t, seed, seconds),
        (_omega(t + STEP, seed, seconds) - _omega(t - STEP, seed, seconds)) / (2 * STEP),
    )
    acceleration = attitude.inv().apply((ahead - 2 * here + behind) / STEP**2)
    specific = acceleration + attitude.inv().apply(UP)
    at_cg = specific + np.cross(alpha, R_CG) + np.cross(omega, np.cross(omega, R_CG))
    force = MASS * at_cg
    moment = alpha @ TENSOR + np.cross(omega, omega @ TENSOR) + np.cross(R_CG, force)
    noisy = lambda values, kind: values + noise * NOISE[kind] * draw(size=values.shape)  # noqa: E731
    return PosedRun(
        t=t, joints=noisy(_angles(t, seed, seconds), "joint"), attitude=attitude, omega=noisy(omega, "gyro"),
        acceleration=acceleration, force=noisy(force, "force") + ZERO[:3], moment=noisy(moment, "moment") + ZERO[3:],
        quaternion=attitude.as_quat(), place=noisy(here, "place"), specific_force=noisy(specific, "accelerometer"),
    )  # fmt: skip


# Conventions: each takes a clean run and returns it as another rig would have recorded it


def sound(run):
    return run


def wrench_at_rest(run):
    return replace(run, force=run.attitude.apply(run.force), moment=run.attitude.apply(run.moment))


def half_turned_base(run):
    half = Rotation.from_euler("z", 180, degrees=True)
    rested = wrench_at_rest(run)
    return replace(rested, force=half.apply(rested.force), moment=half.apply(rested.moment))


def zero_at_rest(run):
    plain = replace(run, force=run.force - ZERO[:3], moment=run.moment - ZERO[3:])
    rested = wrench_at_rest(plain)
    return replace(rested, force=rested.force + ZERO[:3], moment=rested.moment + ZERO[3:])


def _weight(run, mass, r_cg, along=UP):
    force = mass * run.attitude.inv().apply(along)
    return force, np.cross(r_cg, force)


def _regravitated(run, along):
    force, moment = _weight(run, MASS, R_CG, along - UP)
    change = run.attitude.inv().apply(along - UP)
    return replace(run, force=run.force + force, moment=run.moment + moment, specific_force=run.specific_force + change)


def wall(run):
    return _regravitated(run, np.array([-G, 0.0, 0.0]))


def ceiling(run):
    return _regravitated(run, -UP)


def leaning(run):
    return _regravitated(run, Rotation.from_euler("x", 10, degrees=True).apply(UP))


def compensated(run):
    force, moment = _weight(run, MASS, R_CG)
    return replace(run, force=run.force - force, moment=run.moment - moment)


def other_payload(run):
    force, moment = _weight(run, 0.9, np.array([0.0, 0.0, 0.057]))
    return replace(run, force=run.force - force, moment=run.moment - moment)


def accelerometer_down(run):
    return replace(run, specific_force=-run.specific_force)


def linear_acceleration(run):
    """An accelerometer whose driver takes gravity out of its readings."""
    return replace(run, specific_force=run.specific_force - run.attitude.inv().apply(UP))


def _low_passed(corner):
    """A wrench behind a low-pass of first order [Hz], exact for lines from sample to sample; its zero passes whole."""

    def filtered(run):
        step = run.t[1] - run.t[0]
        system = (1.0, [1 / (2 * np.pi * corner), 1.0])
        (taps,), poles, _ = scipy.signal.cont2discrete(system, step, method="foh")
        passed = lambda x: scipy.signal.lfilter(taps, poles, x - x[0], axis=0) + x[0]  # noqa: E731
        return replace(run, force=passed(run.force), moment=passed(run.moment))

    return filtered


def reversed_wrench(run):
    return replace(run, force=-run.force, moment=-run.moment)


def reversed_force(run):
    return replace(run, force=-run.force)


def clocks_apart(run):
    return replace(run, wrench_late=0.4)


def joints_in_any_order(run):
    return replace(run, orders=720)


def in_bunches(run):
    """A wrench by a serial chip that sends every 16 ms, stamped as it arrives, 1 ns apart."""
    return replace(run, arrives=0.016 * np.ceil(run.t / 0.016 - 1e-9) + 1e-9 * np.arange(len(run.t)))


def booted_clock(run):
    return replace(run, wrench_late=START * 1e-9 - 37.0)


def _in_units(force, moment):
    """The wrench in units of so many newtons and newton metres."""
    return lambda run: replace(run, force=run.force / force, moment=run.moment / moment)


def strain_gauge(run):
    """A load cell whose zero is twice the weight."""
    return replace(run, force=run.force + [20.0, -10.0, 30.0], moment=run.moment + [0.5, -0.2, 0.3])


def not_a_number(run):
    """One sample of each sensor that holds no number."""
    force, joints, omega = run.force.copy(), run.joints.copy(), run.omega.copy()
    force[300], joints[400], omega[400] = np.nan, np.nan, np.nan
    return replace(run, force=force, joints=joints, omega=omega)


def inverse_quaternion(run):
    return replace(run, quaternion=run.quaternion * [-1, -1, -1, 1])


def scalar_first(run):
    return replace(run, quaternion=run.quaternion[:, [3, 0, 1, 2]])


def degrees_twice(run):
    """An angular velocity that was taken for degrees though it was in rad/s."""
    return replace(run, omega=np.radians(run.omega))


def no_accelerometer(run):
    return replace(run, specific_force=np.zeros_like(run.specific_force))


def no_accelerometer_ceiling(run):
    return no_accelerometer(ceiling(run))


def gyro_turned(run):
    """A gyro with other axes than those of the quaternion, as of two sensors."""
    return replace(run, omega=run.omega[:, [2, 0, 1]])


def grasped_midway(run):
    """Nothing but the load cell's zero in the first half."""
    empty = np.random.default_rng(9).normal(ZERO, [0.05] * 3 + [2e-3] * 3, (len(run.t), 6))
    held = (run.t > run.t[-1] / 2)[:, None]
    return replace(run, force=np.where(held, run.force, empty[:, :3]), moment=np.where(held, run.moment, empty[:, 3:]))


CONVENTIONS = {
    function.__name__: function
    for function in (
        sound, wrench_at_rest, half_turned_base, zero_at_rest, wall, ceiling, leaning, compensated, other_payload,
        accelerometer_down, linear_acceleration, reversed_wrench, reversed_force, clocks_apart, booted_clock,
        in_bunches, joints_in_any_order, strain_gauge, not_a_number, grasped_midway, inverse_quaternion, scalar_first, degrees_twice, gyro_turned, no_accelerometer,
        no_accelerometer_ceiling,
    )
}  # fmt: skip
CONVENTIONS |= {"low_passed_at_3_Hz": _low_passed(3.0)}
CONVENTIONS |= {
    "newton_millimetres": _in_units(1.0, 1e-3), "newton_centimetres": _in_units(1.0, 1e-2),
    "pounds_and_inches": _in_units(4.4482216, 0.11298483), "pounds_and_feet": _in_units(4.4482216, 1.3558179),
    "kilograms": _in_units(9.80665, 1.0), "kilograms_and_centimetres": _in_units(9.80665, 9.80665e-2),
}  # fmt: skip


def _messages(run, source, store):
    """The messages of a run: log time, topic, type, message."""
    items, types = [], store.types
    stamped = types["geometry_msgs/msg/WrenchStamped"]
    names = {"joints": "sensor_msgs/msg/JointState", "poses": "geometry_msgs/msg/PoseStamped"}
    names["odometry"] = "nav_msgs/msg/Odometry"
    kind = names.get(source, "sensor_msgs/msg/Imu")
    empty, unknown = np.zeros(0), np.zeros(9)
    quaternion = run.quaternion if source == "quaternion" else np.tile([0.0, 0, 0, 1], (len(run.t), 1))
    measured, arrived = (
        (START + np.round(t * 1e9).astype(np.int64)).tolist()
        for t in (run.t, run.t if run.arrives is None else run.arrives)
    )
    draw = np.random.default_rng(7)
    orders = [np.arange(len(NAMES)), *(draw.permutation(len(NAMES)) for _ in range(run.orders - 1))]
    for k, (time, arrival) in enumerate(zip(measured, arrived, strict=True)):
        at = arrival - round(run.wrench_late * 1e9)
        items.append(
            (
                arrival,
                "/wrench",
                stamped.__msgtype__,
                stamped(header(store, at, "tool0"), wrench(store, run.force[k], run.moment[k])),
            )
        )
        head = header(store, time, "root")
        if source == "joints":
            order = orders[draw.integers(run.orders)]
            message = types[kind](head, [NAMES[n] for n in order], run.joints[k][order], empty, empty)
        elif source in ("poses", "odometry"):
            point, turn = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"]
            pose = types["geometry_msgs/msg/Pose"](point(*run.place[k]), turn(*run.quaternion[k]))
            twist = types["geometry_msgs/msg/Twist"](vector(store, np.zeros(3)), vector(store, run.omega[k]))
            spread = types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36))
            rates = types["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36))
            message = types[kind](head, pose) if source == "poses" else types[kind](head, "tool", spread, rates)
        else:
            turn = types["geometry_msgs/msg/Quaternion"](*quaternion[k])
            message = types[kind](
                head, turn, unknown, vector(store, run.omega[k]), unknown, vector(store, run.specific_force[k]), unknown
            )
        if source == "apart":  # as cameras do: gyro and accelerometer, at half the rate, in topics of their own
            message = replace(message, linear_acceleration=vector(store, np.zeros(3)))
            alone = replace(message, angular_velocity=vector(store, np.zeros(3)))
            alone = replace(alone, linear_acceleration=vector(store, run.specific_force[k]))
            items += [(time, "/accelerometer", kind, alone)] * (k % 2 == 0)
        items.append((time, "/motion", kind, message))
    return sorted(items, key=lambda item: item[0])


def write(path, run, source, container):
    """Write a run; returns its path."""
    items = _messages(run, source, ROS1 if container == "ros1" else STORE)
    if container == "ros1":
        write_ros1(path.with_suffix(".bag"), items)
        return path.with_suffix(".bag")
    write_rosbag2(path, items, plugin=getattr(StoragePlugin, container.upper()))
    return path


def experiment(folder, source, *, body_declared=False, band=BAND, **recording):
    """The experiment file of a run; ``body_declared``: its body, too; ``recording``: further keys, as TOML has them."""
    keys = {"wrench": "on_body", "method": "joint"} | recording
    if source == "joints":
        urdf(folder / "arm.urdf")
        down = ["0 m/s^2", "0 m/s^2", f"-{G} m/s^2"]
        keys = {"urdf": "arm.urdf", "urdf_frame": "tool", "urdf_gravity": down} | keys
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())
    r_cg = '["20 mm", "-30 mm", "48 mm"]\nmass = "2 kg"' if body_declared else '["0 mm", "0 mm", "50 mm"]'
    sigma = "0.001 m" if body_declared else "0.1 m"
    (folder / "e.toml").write_text(
        f'[body]\nr_cg_from_q = {r_cg}\n[platform]\ngravity = "9.81 m/s^2"\n'
        '[[estimator]]\nname = "s"\ndifferentiator = "savitzky-golay"\n'
        f'band = "{band} Hz"\n'
        f'[[source]]\nname = "r_cg"\ntarget = "r_cg"\nkind = "bias"\nsigma = "{sigma}"\ngroup = "cg"\n'
        f"[recording]\n{lines}"
    )
    from uq.experiment.experiment import Experiment

    return Experiment.load(folder / "e.toml")


CLEAN = (
    ("joints", 50.0), ("joints", 125.0), ("joints", 500.0), ("imu", 125.0), ("imu", 500.0), ("quaternion", 125.0),
    ("poses", 125.0), ("odometry", 125.0),
)  # fmt: skip
"""Sources of attitude, and rates [Hz], of clean runs."""


def main(arguments=None):
    from identify.exceptions import RunError
    from uq.runs.identification.identify_files import identify_files
    from uq.runs.inspection.experiment_findings import experiment_findings
    from uq.runs.recorded.load_run import load

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20, help="of each kind, with the mass declared and without")
    parser.add_argument("--identify", action="store_true", help="count the warnings of identify, too")
    asked = parser.parse_args(arguments)
    totals = np.zeros(3, int)
    for source, rate in CLEAN:
        for body_declared in (False, True):
            counts = np.zeros(3, int)
            for seed in range(asked.runs):
                with tempfile.TemporaryDirectory() as folder:
                    path = write(Path(folder) / f"{source}-{seed}", measured(seed, rate=rate), source, "mcap")
                    band = min(BAND, 0.035 * rate)  # the highest that joints of this rate tell
                    declared = experiment(Path(folder), source, body_declared=body_declared, band=band)
                    run = load(path, declared.recording, band=band, marks=False).run
                    texts = [str(finding) for finding in experiment_findings(run, declared)]
                    warned = ()
                    if asked.identify:
                        try:
                            warned = identify_files([path], declared).warnings
                        except RunError as error:
                            warned = (str(error),)
                counts += [1, bool(texts), bool(warned)]
                for text in (*texts, *warned):
                    print(f"{source}, {rate:g} Hz, seed {seed}: {text}", flush=True)
            totals += counts
            mass = "mass declared" if body_declared else "mass unknown"
            print(f"{source}, {rate:g} Hz, {mass}: {_told(counts, asked.identify)}", flush=True)
    print(f"in all: {_told(totals, asked.identify)}")


def _told(counts, identified):
    warned = f", {counts[2]} warned by identify" * identified
    return f"{counts[1]} of {counts[0]} clean runs suspected{warned}"


if __name__ == "__main__":
    main()
