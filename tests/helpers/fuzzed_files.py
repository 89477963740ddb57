"""Every kind of file that a user can hand in, as :mod:`tests.helpers.fuzz` mutates them: shipped files, and some made here."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import zstandard
from mcap.writer import CompressionType

from identify.estimation.static_poses.centre import centre
from rig import runs
from tests.helpers import bags
from tests.helpers.pose_lab import GRAVITY, directions, wrench_of
from tests.helpers.small_campaign import TRIALS
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import RunOptions, montecarlo
from uq.monte_carlo.campaign.simulation import simulate
from uq.monte_carlo.trials import checkpoint

ROOT = Path(__file__).parents[2]

BODIES = ("cylinder", "cad-report")
"""Files of uq/examples that are no experiments."""


@dataclass(frozen=True)
class Kind:
    """A kind of file: shipped or made ones, and the command that reads it."""

    suffix: str
    made: tuple[bytes, ...] | Callable[[], tuple[bytes, ...]]
    """The files, or what makes them when they are asked for."""
    command: Callable[[str], list[str]]
    """From the file's name to the command's arguments."""
    text: bool = True
    behind: str = ""
    """What the command complains of once it has loaded an original; empty: of nothing."""
    sealed: Callable[[bytes], bytes] = bytes
    """Gives a mutated file the checksum of its content."""

    @cached_property
    def originals(self) -> tuple[bytes, ...]:
        """The files."""
        return self.made() if callable(self.made) else self.made


def kinds(folder: Path) -> dict[str, Kind]:
    """Make the files that are not shipped, in a folder; return every kind by name."""
    experiments = ROOT / "uq" / "examples"
    for name in ("designed.csv", "many-errors-cg.csv", "arm.urdf"):
        shutil.copy(experiments / name, folder)
    brief = (ROOT / "uq" / "examples" / "t1-10s.toml").read_bytes().replace(b'"10 s"', b'"4 s"')
    brief = brief.replace(b'"1.5 s"', b'"0.6 s"').replace(b'"400 Hz"', b'"200 Hz"')
    (folder / "e.toml").write_bytes(brief)
    run = simulate(Experiment.load(folder / "e.toml"), "T1")
    run.write(folder / "run.mcap")
    packed, plain = (folder / "run.mcap").read_bytes(), _unchecked(folder)
    return {
        "experiment": Kind(
            ".toml",
            tuple(
                path.read_bytes()
                for path in sorted(experiments.glob("*.toml"))
                if not path.stem.startswith(("rig-", *BODIES))
            )
            + ((ROOT / "uq" / "presets" / "barreto2016.toml").read_bytes(), brief),
            lambda name: ["inspect", "plain.mcap", "--experiment", name],
        ),
        "declared": Kind(
            ".toml", (brief, *_declared(brief)), lambda name: ["identify", "run.mcap", "--experiment", name]
        ),
        "body": Kind(
            ".toml",
            tuple((experiments / f"{name}.toml").read_bytes() for name in BODIES),
            lambda name: ["identify", "nothing.mcap", "--experiment", "e.toml", "--expected", name],
            behind="nothing.mcap",
        ),
        "rig": Kind(
            ".toml",
            tuple(path.read_bytes() for path in sorted(experiments.glob("rig-*.toml"))),
            lambda name: ["record", name, "--seconds", "0.1", "-o", "nowhere/run.mcap"],
            behind="no folder nowhere",
        ),
        "map": Kind(".toml", MAPS, lambda name: ["import", "table.csv", "--map", name, "-o", _fresh("made.mcap")]),
        "table": Kind(
            ".csv", (_table(folder),), lambda name: ["import", name, "--map", "m.toml", "-o", _fresh("m.mcap")]
        ),
        "poses": Kind(".csv", (_poses(folder),), lambda name: ["centre", name, "--experiment", "poses.toml"]),
        "centre": Kind(
            ".json",
            (_centre(),),
            lambda name: ["identify", "nothing.mcap", "--experiment", "e.toml", "--centre", name],
            behind="nothing.mcap",
        ),
        "mcap": Kind(".mcap", (packed, plain), lambda name: ["inspect", name], text=False),
        "zst": Kind(
            ".mcap.zst",
            (zstandard.ZstdCompressor(write_checksum=False).compress(plain),),
            lambda name: ["inspect", name],
            text=False,
        ),
        "cut": Kind(
            ".mcap",
            (packed, plain),
            lambda name: ["recover", name, "-o", _fresh("whole.mcap")],
            text=False,
        ),
        "run": Kind(".mcap", (plain,), lambda name: ["identify", name, "--experiment", "e.toml"], text=False),
        "bag": Kind(".bag", (_bag(folder, ".bag"),), lambda name: ["inspect", name], text=False),
        "urdf": Kind(".urdf", (_robot(folder),), _with_robot),
        "checkpoint": Kind(
            ".part",
            partial(_campaign, folder, "*.part"),
            lambda name: _resumed(name, "*.part"),
            text=False,
            sealed=_sealed,
        ),
        "campaign": Kind(
            ".json", partial(_campaign, folder, "campaign.json"), lambda name: _resumed(name, "campaign.json")
        ),
        "sqlite": Kind(".db3", (_bag(folder, ".db3"),), lambda name: ["inspect", name], text=False),
    }


MAP = b"""[columns]
time = "t"
time_unit = "s"
force = ["Fx", "Fy", "Fz"]
moment = ["Mx", "My", "Mz"]
angular_velocity = ["wx", "wy", "wz"]
[recording]
wrench = "on_body"
force_unit = "N"
moment_unit = "N*m"
angular_velocity_unit = "rad/s"
wrench_rotation_to_body = "x, y, z"
imu_rotation_to_body = "x, y, z"
"""
OTHERS = (
    ("on_body", "on_sensor"),
    ('"s"', '"ms"'),
    ('"N"', '"kN"'),
    ("N*m", "N*mm"),
    ("rad/s", "deg/s"),
    ("x, y, z", "y, -x, z"),
)
"""Other conventions of a map."""
MAPS = (MAP, *(MAP.replace(usual.encode(), other.encode()) for usual, other in OTHERS))


def _declared(brief: bytes) -> list[bytes]:
    """The same experiment with other methods and declarations of a recording."""
    more = (
        b'method = "gls"\noffsets = "none"', b'method = "joint"\ncg_motion = "still"\nsigma_delay = "1 ms"',
        b'sigma_rotation = "2 deg"\noffsets = "none"',
    )  # fmt: skip
    return [brief.replace(b"[recording]", b"[recording]\n" + keys) for keys in more]


def _fresh(name: str) -> str:
    Path(name).unlink(missing_ok=True)
    return name


def _table(folder: Path) -> bytes:
    rows = np.column_stack([0.01 * np.arange(60), np.random.default_rng(0).normal(size=(60, 9))])
    head = "t,Fx,Fy,Fz,Mx,My,Mz,wx,wy,wz\n"
    content = (head + "\n".join(",".join(map("{:.6g}".format, row)) for row in rows) + "\n").encode()
    (folder / "table.csv").write_bytes(content)
    (folder / "m.toml").write_bytes(MAP)
    return content


def _poses(folder: Path) -> bytes:
    up = directions(np.random.default_rng(1), 12, None)
    force, moment = wrench_of(up)
    (folder / "poses.toml").write_text(
        f'[platform]\ngravity = "{GRAVITY} m/s^2"\n[recording]\nwrench = "on_body"\nforce_unit = "N"\nmoment_unit = "N*m"\n'
        'wrench_rotation_to_body = "x, y, z"\nimu_rotation_to_body = "x, y, z"\nacceleration_unit = "m/s^2"\n[poses]\n'
        'force = ["fx", "fy", "fz"]\nmoment = ["mx", "my", "mz"]\nacceleration = ["ax", "ay", "az"]\n'
    )
    rows = np.hstack([force, moment, up])
    return ("fx,fy,fz,mx,my,mz,ax,ay,az\n" + "\n".join(",".join(map("{:.6g}".format, row)) for row in rows)).encode()


def _centre() -> bytes:
    up = directions(np.random.default_rng(1), 12, None)
    noise = np.random.default_rng(2).normal(size=(12, 6)) * 0.01
    force, moment = wrench_of(up)
    return json.dumps(centre(force + noise[:, :3], moment + noise[:, 3:], up).to_dict(), indent=1).encode()


def _bag(folder: Path, suffix: str) -> bytes:
    recording = runs.read(folder / "run.mcap")
    store = bags.ROS1 if suffix == ".bag" else bags.STORE
    items = bags.merged(recording.wrench, recording.imu, store=store)[:400]
    if suffix == ".bag":
        bags.write_ros1(folder / "made.bag", items)
        return (folder / "made.bag").read_bytes()
    bags.write_rosbag2(folder / "made", items, plugin=bags.StoragePlugin.SQLITE3)
    return next((folder / "made").glob("*.db3")).read_bytes()


def _unchecked(folder: Path) -> bytes:
    """The same run without compression and check sums, so that a mutated byte reaches what reads the messages."""
    recording = runs.read(folder / "run.mcap")
    bags.write_mcap(
        folder / "plain.mcap",
        bags.merged(recording.wrench, recording.imu)[:400],
        encoding="cdr",
        schema_encoding="ros2msg",
        encode=lambda message, kind: bytes(bags.STORE.serialize_cdr(message, kind)),
        compression=CompressionType.NONE,
        enable_crcs=False,
    )
    return (folder / "plain.mcap").read_bytes()


LINKS = """<link name="link_{0}"/><joint name="arm_{0}" type="{1}"><parent link="{2}"/><child link="link_{0}"/>
<origin xyz="0 0 0.1" rpy="0.1 0 0"/><axis xyz="{3}"/>{4}</joint>
"""


def _robot(folder: Path) -> bytes:
    """An arm of four joints, and a recording of them beside a wrench."""
    limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
    parents = ("base", "link_1", "link_2", "link_3")
    kinds_of_joint = ("revolute", "continuous", "revolute", "fixed")
    axes = ("0 0 1", "0 1 0", "1 0 0", "0 0 1")
    links = "".join(
        LINKS.format(k + 1, kinds_of_joint[k], parents[k], axes[k], limit if kinds_of_joint[k] == "revolute" else "")
        for k in range(4)
    )
    store, items, rng = bags.STORE, [], np.random.default_rng(3)
    for k in range(200):
        time = 10**9 + k * 10**7
        angles = np.sin(np.arange(1, 4) + 0.05 * k)
        joints = store.types["sensor_msgs/msg/JointState"](
            bags.header(store, time, ""), ["arm_1", "arm_2", "arm_3"], angles, np.zeros(0), np.zeros(0)
        )
        wrench = store.types["geometry_msgs/msg/WrenchStamped"](
            bags.header(store, time, "wrist"), bags.wrench(store, rng.normal(size=3), rng.normal(size=3))
        )
        items += [(time, "/joint_states", "sensor_msgs/msg/JointState", joints)]
        items += [(time, "/wrist", "geometry_msgs/msg/WrenchStamped", wrench)]
    bags.write_rosbag2(folder / "arm", items)
    (folder / "arm.toml").write_text(
        '[body]\nr_cg_from_q = ["0 m", "0 m", "0 m"]\n'
        '[recording]\nwrench = "on_body"\nurdf = "robot.urdf"\nurdf_frame = "link_4"\n'
        '[[estimator]]\nname = "s"\ndifferentiator = "savitzky-golay"\nband = "2 Hz"\n'
    )
    return f'<robot name="arm">\n<link name="base"/>\n{links}</robot>\n'.encode()


def _with_robot(name: str) -> list[str]:
    shutil.copy(name, "robot.urdf")
    return ["identify", "arm", "--experiment", "arm.toml"]


def _campaign(folder: Path, name: str) -> tuple[bytes, ...]:
    """The first file of a name in the checkpoint of a campaign, which is run once."""
    if not (folder / "done").exists():
        montecarlo(Experiment.load(folder / "e.toml"), trials=TRIALS, options=RunOptions(checkpoint=folder / "done"))
    return tuple(path.read_bytes() for path in sorted((folder / "done").glob(name))[:1])


def _sealed(part: bytes) -> bytes:
    """A part of a campaign with the checksum of what it holds, so that more than the checksum is tried."""
    line, _, payload = part.partition(b"\n")
    try:
        header = json.loads(line)
        del header["sha256"]
    except (ValueError, KeyError, TypeError):
        return part
    return json.dumps(header | {"sha256": checkpoint._checksum(header, payload)}).encode() + b"\n" + payload


def _resumed(name: str, place: str) -> list[str]:
    """A campaign that goes on from a folder in which one file is another."""
    shutil.rmtree("out", ignore_errors=True)
    shutil.copytree("done", "out/checkpoint")
    shutil.copy(name, min(Path("out/checkpoint").glob(place)))
    return ["montecarlo", "e.toml", "--trials", str(TRIALS), "--out", "out"]
