"""What the tests cost: ``python -m benchmarks.tests [FILE]`` prints the dearest tests and files, and how workers ended.

FILE is what a run with ``INERTIA_TEST_USAGE=FILE`` wrote; without it, pytest runs now, with all that follows ``--``:

    python -m benchmarks.tests -- -n 2 --dist loadfile tests/uq/monte_carlo/campaign
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from identify.display.text_tables import text_table


class Usage(NamedTuple):
    """What a test took."""

    seconds: float
    """User time, that of processes it waited for included."""
    megabytes: int
    """By how much it raised the largest memory of its worker."""
    test: str


def usages(text: str) -> tuple[list[Usage], dict[str, int]]:
    """Return what each test took, and the largest memory [MB] of each worker, from the lines of a usage file."""
    found, largest = [], defaultdict(int)
    for line in text.splitlines():
        seconds, memory, _, worker, test = line.split("\t", 4)
        found.append(Usage(float(seconds), max(0, int(memory) - largest[worker]), test))
        largest[worker] = max(largest[worker], int(memory))
    return found, dict(largest)


def by_file(found: Sequence[Usage]) -> list[Usage]:
    """Return the sums of each file."""
    files = defaultdict(list)
    for usage in found:
        files[usage.test.split("::")[0]].append(usage)
    return [Usage(sum(u.seconds for u in each), sum(u.megabytes for u in each), name) for name, each in files.items()]


def table(found: Sequence[Usage], head: str, count: int) -> str:
    """Return the dearest as a table."""
    dearest = sorted(found, reverse=True)[:count]
    rows = [[f"{usage.seconds:.1f}", f"{usage.megabytes}", usage.test] for usage in dearest]
    return str(text_table(["user time, s", "memory, MB more", head], rows))


def report(text: str, count: int) -> str:
    """Return both tables and the sum of all."""
    found, largest = usages(text)
    workers = ", ".join(f"{name} {memory} MB" for name, memory in sorted(largest.items()))
    total = f"{len(found)} tests, {sum(usage.seconds for usage in found):.0f} s of user time; largest memory: {workers}"
    return "\n\n".join([table(found, "test", count), table(by_file(found), "file", count), total])


def run(options: Sequence[str]) -> str:
    """Run pytest and return what it wrote of each test."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "usage")
        command = [sys.executable, "-m", "pytest", "-q", *options]
        subprocess.run(command, env={**os.environ, "INERTIA_TEST_USAGE": str(file)}, check=False)
        return file.read_text("utf-8") if file.exists() else ""


def main() -> None:
    """Print the tables of a file, or of a run."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("file", nargs="?", type=Path, help="what a run wrote; otherwise pytest runs")
    arguments.add_argument("--count", type=int, default=20, metavar="N", help="rows of each table")
    given = sys.argv[1:]
    cut = given.index("--") if "--" in given else len(given)
    options = arguments.parse_args(given[:cut])
    print(report(options.file.read_text("utf-8") if options.file else run(given[cut + 1 :]), options.count))


if __name__ == "__main__":
    main()
