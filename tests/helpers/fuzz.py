"""``python -m tests.helpers.fuzz --minutes 60``: every kind of file that a user can hand in, mutated (``make fuzz``).

Whatever the file holds, a command ends with a legitimate result, or with exit status 2 and one line of less than 200
characters, within 10 s and 2 GiB. Texts are mutated key by key, everything byte by byte; a failure is written beside
the others, with the line that repeats it. :mod:`tests.test_fuzz` runs a short form.
"""

import argparse
import contextlib
import io
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import struct
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

from tests.helpers.fuzzed_files import Kind, kinds  # noqa: E402
from uq.cli.main import main  # noqa: E402

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
NUMBER = re.compile(rb"(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?")
NUMBERS = (b"0", b"1", b"-1", b"1e-9", b"1e-3", b"0.5", b"3", b"50", b"1e6", b"1e12", b"1e300")
FACTORS = (0.1, 0.5, 0.8, 0.9, 1.1, 1.2, 2.0, 10.0, 0.0, -1.0)


def mutated(rng: random.Random, kind: Kind) -> bytes:
    """One of a kind's files, with one to three mutations; three of four texts are such as mostly load."""
    data = rng.choice(kind.originals)
    usual = kind.text and rng.random() < 0.75
    for _ in range(rng.randint(1, 3)):
        if usual:
            data = _number_scaled(rng, data) if rng.random() < 0.67 else _value_exchanged(rng, kind, data)
        elif kind.text and rng.random() < 0.8:
            data = _key_mutated(rng, data)
        else:
            data = _byte_mutated(rng, data)
    return kind.sealed(data)


def _number_scaled(rng: random.Random, data: bytes) -> bytes:
    """Another size or sign of one number, whose unit stays; whole numbers stay whole."""
    values = [place.span(2) for place in ASSIGNMENT.finditer(data)] or [(0, len(data))]
    places = [number for start, stop in values for number in NUMBER.finditer(data, start, stop)]
    if not places:
        return data
    place = rng.choice(places)
    scaled = float(place[0]) * rng.choice(FACTORS)
    number = f"{scaled:.0f}" if place[0].lstrip(b"-").isdigit() else f"{scaled:.9g}"
    return data[: place.start()] + number.encode() + data[place.end() :]


def _value_exchanged(rng: random.Random, kind: Kind, data: bytes) -> bytes:
    """The value of a key that another place or file of the kind has for a key of this name."""
    places = list(ASSIGNMENT.finditer(data))
    if not places:
        return _number_scaled(rng, data)
    place = rng.choice(places)
    others = [
        other[2]
        for file in kind.originals
        for other in ASSIGNMENT.finditer(file)
        if other[1].strip() == place[1].strip()
    ]
    return data[: place.start(2)] + rng.choice([*others, place[2]]) + data[place.end(2) :]


def _key_mutated(rng: random.Random, data: bytes) -> bytes:
    """Another value, no key, two of it, another name, or a text of anything for one key."""
    places = list(ASSIGNMENT.finditer(data)) or list(NUMBER.finditer(data))
    if not places:
        return data
    place = rng.choice(places)
    before, value, end = place.groups() if place.re is ASSIGNMENT else (b"", place[0], b"")
    others = [other[2] if other.re is ASSIGNMENT else other[0] for other in places]
    text = "".join(chr(rng.choice((rng.randrange(128), rng.randrange(0xD800)))) for _ in range(rng.randrange(40)))
    line = rng.choice(
        (
            before + NUMBER.sub(rng.choice(NUMBERS), value, count=1) + end,
            before + rng.choice(VALUES).encode() + end,
            before + rng.choice(others) + end,
            rng.choice((b"", before + value + end + b"\n" + before + value + end, b"_" + before + value + end)),
            before + json.dumps(text).encode() + end,
            before + repr(struct.unpack("d", rng.randbytes(8))[0]).encode() + end,
        )
    )
    return data[: place.start()] + line + data[place.end() :]


def _byte_mutated(rng: random.Random, data: bytes) -> bytes:
    """Some bytes turned, overwritten, inserted, repeated, or cut off."""
    at = rng.randrange(max(len(data), 1))
    few = rng.choice((rng.randbytes(rng.randint(1, 3)), rng.randbytes(8), struct.pack("<d", 10 ** rng.uniform(-9, 12))))
    many = rng.choice((b"\xff" * 8, b"\x00" * 64, b"\x7f" + b"\xff" * 7, few))
    overwritten = data[:at] + few + data[at + len(few) :]  # most often: what is behind stays where it was
    return rng.choice(
        (
            overwritten, overwritten, overwritten,
            data[:at] + many + data[at + len(many) :],
            data[:at] + many + data[at:],
            data[:at] + data[at : at + 200] * 2 + data[at + 200 :],
            data[:at],
        )
    )  # fmt: skip


class TooLongError(BaseException):
    """A command does not end; no command takes it for a failure of its own."""


class Outcome(NamedTuple):
    """What is wrong with how a command takes a file, empty if nothing is; and whether it was loaded."""

    problem: str
    loaded: bool = False


def outcome(kind: Kind, data: bytes) -> Outcome:
    """How the command takes a file of this kind."""
    Path(f"input{kind.suffix}").write_bytes(data)
    out, err = io.StringIO(), io.StringIO()
    before, start, used = _memory("VmRSS", forget=True), time.monotonic(), time.process_time()
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
        return Outcome(f"{type(error).__name__}: {str(error)[:100]!r} at {at.filename}:{at.lineno}")
    lines = err.getvalue().splitlines()
    if min(time.monotonic() - start, time.process_time() - used) > SECONDS:  # others may keep the machine busy
        return Outcome("takes longer than ten seconds")
    if _memory("VmHWM") - before > BYTES:
        return Outcome("takes more than 2 GiB")
    if status not in (0, 1, 2):
        return Outcome(f"exit status {status}")
    if status == 2 and (len(lines) != 1 or len(lines[0]) >= CHARACTERS or not lines[0].isprintable()):
        return Outcome(f"{len(lines)} lines, {len(err.getvalue())} characters: {err.getvalue()[:300]!r}")
    if unexpected := re.search(r"Traceback|\w*Warning: .*", err.getvalue()):
        return Outcome(f"prints {unexpected[0][:100]}")
    return Outcome("", kind.behind in err.getvalue() if kind.behind else status != 2)


def refused_originals(kind: Kind) -> list[int]:
    """Return the originals of a kind behind whose loading nothing would be tried."""
    outcome(kind, kind.originals[0])  # what only a first run imports and compiles is not counted
    return [k for k, data in enumerate(kind.originals) if outcome(kind, data) != Outcome("", True)]


def _memory(name: str, *, forget: bool = False) -> int:
    """Return a figure of this process's memory [bytes], 0 where the system tells none; forget the peak before."""
    with contextlib.suppress(OSError):
        if forget:
            Path("/proc/self/clear_refs").write_text("5")
        return 1024 * int(re.search(rf"{name}:\s*(\d+)", Path("/proc/self/status").read_text())[1])
    return 0


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    """Interrupt what does not end, on a busy machine neither."""

    def late(*_: object) -> None:
        raise TooLongError("does not end")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60 * SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def fuzz(kind: Kind, cases: int, number: int = 0) -> tuple[int, dict[str, bytes]]:
    """Try so many mutated files; return how many were loaded, and the smallest of each complaint's place."""
    rng, loaded, failures = random.Random(number), 0, dict[str, bytes]()
    for _ in range(cases):
        data = mutated(rng, kind)
        problem, behind = outcome(kind, data)
        loaded += behind
        if problem:
            place = re.sub(r"'.*'|\d{3,}", "…", problem)[:120] + problem[-40:]
            failures[place] = min(data, failures.get(place, data), key=len)
    return loaded, failures


def attack(chosen: Sequence[str] | None, seconds: float, number: int, keep: Path, report: Any) -> None:
    """Fuzz kinds in turn, in a folder of this process, until the time is over; put what was tried into a queue."""
    tried, loaded = Counter[str](), Counter[str]()
    failed: set[tuple[str, str]] = set()
    folder = keep / f"process-{os.getpid()}"
    folder.mkdir(parents=True)
    os.chdir(folder)
    every = kinds(folder)
    failed |= {(which, "an original is refused") for which in chosen or every if refused_originals(every[which])}
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for which in chosen or every:
            behind, failures = fuzz(every[which], 50, number)
            tried[which] += 50
            loaded[which] += behind
            for place, data in failures.items():
                if (which, place) not in failed:
                    file = keep / f"{which}-{os.getpid()}-{len(failed)}{every[which].suffix}"
                    file.write_bytes(data)
                    print(f"{which}: {place}\n  inertia {' '.join(every[which].command(str(file)))}", flush=True)
                failed.add((which, place))
            if time.monotonic() > end:
                break
        number += 1
    report.put((tried, loaded, failed, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss))
    os.chdir(keep)
    shutil.rmtree(folder)


def run() -> int:
    """Fuzz every kind in turn, in every processor, until the time is over; print what was tried."""
    parser = argparse.ArgumentParser(prog="python -m tests.helpers.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--kind", action="append", help="repeatable (all)")
    parser.add_argument("--keep", default="out/fuzz", help="folder of the files that fail")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    keep = Path(arguments.keep).resolve()
    started = random.SystemRandom().randrange(2**31)
    spawn = multiprocessing.get_context("spawn")
    report = spawn.Queue()
    given = [
        (arguments.kind, 60 * arguments.minutes, started + 10**6 * k, keep, report) for k in range(arguments.processes)
    ]
    workers = [spawn.Process(target=attack, args=each) for each in given]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    died = [worker for worker in workers if worker.exitcode]
    for worker in died:
        print(f"a process ended with {worker.exitcode}: its input is in {keep / f'process-{worker.pid}'}")
    reports = [report.get() for _ in range(len(workers) - len(died))]
    tried, loaded = (sum((each[k] for each in reports), Counter()) for k in (0, 1))
    failed = set().union(*(each[2] for each in reports))
    shares = (f"{which}: {count:,} files, {loaded[which] / count:.0%} loaded" for which, count in tried.items())
    print(*shares, *(f"{which}: {place}" for which, place in sorted(failed)), sep="\n")
    print(
        f"{tried.total():,} files in {len(workers)} processes, {len(failed) + len(died)} kinds of failure; most memory "
        f"{max((each[3] for each in reports), default=0) / 2**20:.2f} GiB"
    )
    return int(bool(failed or died))


if __name__ == "__main__":
    sys.exit(run())
