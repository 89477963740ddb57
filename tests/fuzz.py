"""``python -m tests.fuzz --minutes 60``: every kind of file that a user can hand in, mutated (``make fuzz``).

Whatever the file holds, a command ends with a legitimate result, or with exit status 2 and one line of less than 200
characters, within 10 s and 2 GiB. Texts are mutated key by key, everything byte by byte; a failure is written beside
the others, with the line that repeats it. :mod:`tests.test_fuzz` runs a short form.
"""

import argparse
import contextlib
import io
import json
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

jax.config.update("jax_enable_x64", True)

from identify.static.centre import centre  # noqa: E402
from tests import bags  # noqa: E402
from tests.pose_lab import GRAVITY, directions, wrench_of  # noqa: E402
from uq.campaign.simulation import simulate  # noqa: E402
from uq.cli.main import main  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402

ROOT = Path(__file__).parents[1]
SECONDS, BYTES, CHARACTERS = 10, 2 * 2**30, 200
HUGE = "9" * 401
TEXTS = (
    "", "nan", "-inf", "1e400", HUGE, "x" * 20_000, "a\\nb", "\\u0000", "\\u202e", "é" * 300, "1 kg", "0 m", "-1 N",
    "1e308 mm", "1 " + "kg*" * 500 + "kg", "1 N^9^9", "5 furlong", "../../etc", "$HOME", "%s%n", "{0}", "T1", "none",
)  # fmt: skip
VALUES = (
    *(f'"{text}"' for text in TEXTS), HUGE, f"-{HUGE}", "nan", "inf", "1e400", "0", "-1", "3", "0.5", "true", "[]", "{}",
    "[[[]]]", "[nan, nan, nan]", '["1 m", "1 m"]', "[0, 0, 0]", "1979-05-27", "{ I11 = 1 }", '{ x = "y" }', "[1, [2], {}]",
)  # fmt: skip
ASSIGNMENT = re.compile(rb'^(\s*"?[\w.-]+"?\s*[=:]\s*)(.+?)(,?)$', re.MULTILINE)


@dataclass(frozen=True)
class Kind:
    """A kind of file: shipped or made ones, and the command that reads it."""

    suffix: str
    originals: tuple[bytes, ...]
    command: Callable[[str], list[str]]
    """From the file's name to the command's arguments."""
    text: bool = True


@st.composite
def mutated(draw: st.DrawFn, kind: Kind) -> bytes:
    """One of a kind's files, with one to three mutations."""
    data = draw(st.sampled_from(kind.originals))
    for _ in range(draw(st.integers(1, 3))):
        by_key = kind.text and draw(st.integers(0, 4)) > 0
        data = _key_mutated(draw, data) if by_key else _byte_mutated(draw, data)
    return data


def _key_mutated(draw: st.DrawFn, data: bytes) -> bytes:
    """Another value, no key, two of it, another name, or a text of anything for one key."""
    places = list(ASSIGNMENT.finditer(data))
    if not places:
        return data
    place = draw(st.sampled_from(places))
    before, value, end = place.groups()
    others = [other.group(2) for other in places]
    line = draw(
        st.one_of(
            st.sampled_from(VALUES).map(lambda text: before + text.encode() + end),
            st.sampled_from(others).map(lambda other: before + other + end),
            st.sampled_from((b"", before + value + end + b"\n" + before + value + end, b"_" + before + value + end)),
            st.text(max_size=40).map(lambda text: before + json.dumps(text).encode() + end),
            st.floats().map(lambda number: before + repr(number).encode() + end),
        )
    )
    return data[: place.start()] + line + data[place.end() :]


def _byte_mutated(draw: st.DrawFn, data: bytes) -> bytes:
    """Some bytes turned, overwritten, inserted, repeated, or cut off."""
    at = draw(st.integers(0, max(len(data) - 1, 0)))
    more = draw(
        st.one_of(
            st.binary(min_size=1, max_size=16), st.sampled_from((b"\xff" * 8, b"\x00" * 64, b"\x7f" + b"\xff" * 7))
        )
    )
    how = draw(st.integers(0, 4))
    if how == 0:
        return data[:at] + bytes([data[at] ^ (more[0] or 1)]) + data[at + 1 :] if data else more
    if how == 1:
        return data[:at] + more + data[at + len(more) :]
    if how == 2:
        return data[:at] + more + data[at:]
    return data[:at] + data[at : at + 200] * 2 + data[at + 200 :] if how == 3 else data[:at]


def complaint(kind: Kind, data: bytes) -> str:
    """What is wrong with how the command takes a file of this kind; empty if nothing is."""
    Path(f"input{kind.suffix}").write_bytes(data)
    out, err = io.StringIO(), io.StringIO()
    before, start = _memory("VmRSS", forget=True), time.monotonic()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), _alarm():
            try:
                status = main(kind.command(f"input{kind.suffix}"))
            except SystemExit as end:
                status = int(end.code or 0)
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        at = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {str(error)[:100]!r} at {at.filename}:{at.lineno}"
    lines = err.getvalue().splitlines()
    if time.monotonic() - start > SECONDS:
        return "takes longer than ten seconds"
    if _memory("VmHWM") - before > BYTES:
        return "takes more than 2 GiB"
    if status not in (0, 1, 2):
        return f"exit status {status}"
    if status == 2 and (len(lines) != 1 or len(lines[0]) >= CHARACTERS or not lines[0].isprintable()):
        return f"{len(lines)} lines, {len(err.getvalue())} characters: {err.getvalue()[:300]!r}"
    return "" if status == 2 or "Traceback" not in err.getvalue() else "a traceback in what it prints"


def _memory(name: str, *, forget: bool = False) -> int:
    """Return a figure of this process's memory [bytes], 0 where the system tells none; forget the peak before."""
    with contextlib.suppress(OSError):
        if forget:
            Path("/proc/self/clear_refs").write_text("5")
        return 1024 * int(re.search(rf"{name}:\s*(\d+)", Path("/proc/self/status").read_text())[1])
    return 0


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    """Interrupt what takes far too long."""

    def late(*_: object) -> None:
        raise TimeoutError("more than twice ten seconds")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(2 * SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def kinds(folder: Path) -> dict[str, Kind]:
    """Make the files that are not shipped, in a folder; return every kind by name."""
    brief = (ROOT / "docs" / "experiments" / "t1-10s.toml").read_bytes().replace(b'"10 s"', b'"4 s"')
    brief = brief.replace(b'"1.5 s"', b'"0.6 s"').replace(b'"400 Hz"', b'"200 Hz"')
    (folder / "e.toml").write_bytes(brief)
    run = simulate(Experiment.load(folder / "e.toml"), "T1")
    run.write(folder / "run.mcap")
    return {
        "experiment": Kind(
            ".toml",
            tuple(path.read_bytes() for path in sorted((ROOT / "docs" / "experiments").glob("*.toml")))
            + ((ROOT / "uq" / "presets" / "barreto2016.toml").read_bytes(), brief),
            lambda name: ["inspect", "run.mcap", "--experiment", name],
        ),
        "body": Kind(
            ".toml",
            tuple((ROOT / "docs" / "experiments" / f"{name}.toml").read_bytes() for name in ("cylinder", "cad-report")),
            lambda name: ["identify", "nothing.mcap", "--experiment", "e.toml", "--expected", name],
        ),
        "rig": Kind(
            ".toml",
            tuple(path.read_bytes() for path in sorted((ROOT / "docs" / "rigs").glob("*.toml"))),
            lambda name: ["record", name, "--seconds", "0.1", "-o", "nowhere/run.mcap"],
        ),
        "map": Kind(".toml", (MAP,), lambda name: ["import", "table.csv", "--map", name, "-o", _fresh("made.mcap")]),
        "table": Kind(
            ".csv", (_table(folder),), lambda name: ["import", name, "--map", "m.toml", "-o", _fresh("m.mcap")]
        ),
        "poses": Kind(".csv", (_poses(folder),), lambda name: ["centre", name, "--experiment", "poses.toml"]),
        "centre": Kind(
            ".json",
            (_centre(),),
            lambda name: ["identify", "nothing.mcap", "--experiment", "e.toml", "--centre", name],
        ),
        "mcap": Kind(".mcap", ((folder / "run.mcap").read_bytes(),), lambda name: ["inspect", name], text=False),
        "cut": Kind(
            ".mcap",
            ((folder / "run.mcap").read_bytes(),),
            lambda name: ["recover", name, "-o", _fresh("whole.mcap")],
            text=False,
        ),
        "bag": Kind(".bag", (_bag(folder, ".bag"),), lambda name: ["inspect", name], text=False),
        "sqlite": Kind(".db3", (_bag(folder, ".db3"),), lambda name: ["inspect", name], text=False),
    }


MAP = b"""[columns]
time = "t"
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
    from rig import runs

    recording = runs.read(folder / "run.mcap")
    store = bags.ROS1 if suffix == ".bag" else bags.STORE
    items = bags.merged(recording.wrench, recording.imu, store=store)[:400]
    if suffix == ".bag":
        bags.write_ros1(folder / "made.bag", items)
        return (folder / "made.bag").read_bytes()
    bags.write_rosbag2(folder / "made", items, plugin=bags.StoragePlugin.SQLITE3)
    return next((folder / "made").glob("*.db3")).read_bytes()


def fuzz(kind: Kind, cases: int, number: int | None = None) -> tuple[int, dict[str, bytes]]:
    """Try so many mutated files; return how many were tried, and the smallest file of each complaint's place."""
    tried, failures = 0, {}

    @settings(
        max_examples=cases,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        derandomize=number is None,
        phases=[Phase.generate],
    )
    @given(mutated(kind))
    def try_one(data: bytes) -> None:
        nonlocal tried
        tried += 1
        if problem := complaint(kind, data):
            place = re.sub(r"'.*'|\d{3,}", "…", problem)[:120] + problem[-40:]
            if place not in failures or len(data) < len(failures[place]):
                failures[place] = data

    (seed(number)(try_one) if number is not None else try_one)()
    return tried, failures


def run() -> int:
    """Fuzz every kind in turn until the time is over; print what was tried."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--kind", action="append", help="repeatable (all)")
    parser.add_argument("--keep", default="out/fuzz", help="folder of the files that fail")
    arguments = parser.parse_args()
    keep, end = Path(arguments.keep).resolve(), time.monotonic() + 60 * arguments.minutes
    tried: Counter[str] = Counter()
    failed: dict[tuple[str, str], bytes] = {}
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        every = kinds(Path(name))
        chosen = arguments.kind or list(every)
        number = random.SystemRandom().randrange(2**32)
        while time.monotonic() < end:
            for which in chosen:
                count, failures = fuzz(every[which], 100, number)
                tried[which] += count
                for place, data in failures.items():
                    if (which, place) not in failed:
                        keep.mkdir(parents=True, exist_ok=True)
                        file = keep / f"{which}-{len(failed)}{every[which].suffix}"
                        file.write_bytes(data)
                        print(f"{which}: {place}\n  inertia {' '.join(every[which].command(str(file)))}", flush=True)
                    failed[which, place] = data
            number += 1
    print(*(f"{which}: {count:,} files" for which, count in tried.items()), sep="\n")
    print(
        f"{tried.total():,} files, {len(failed)} kinds of failure; most memory "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB"
    )
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(run())
