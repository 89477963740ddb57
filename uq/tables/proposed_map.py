"""A map that is proposed for a table: what its names, units and numbers suggest, every guess with its reason."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from identify.signals.run import RunError
from rig.atomic_files import replacing
from rig.exceptions import RigError, listed, on_one_line
from uq.experiment.recording_table import UNITS
from uq.files.csv_columns import CsvTable, read_rows
from uq.files.table_layout import layout
from uq.files.toml_text import toml_value
from uq.files.units import scale
from uq.tables.table_map import MOTIONS, WRENCH
from uq.tables.table_samples import COUNTS, rate_of_coarse

AXES = {
    "acceleration": "a|acc|accel|accelerometer|acceleration|specific_force",
    "force": "f|force|forces",
    "moment": "t|m|torque|torques|moment|moments",
    "angular_velocity": "w|g|gyr|gyro|gyroscope|omega|angular_velocity|angular_rate|ang_vel|rate",
}
"""Names of signals of three axes in lower case; the first whose name fits takes a column."""
UNLIKELY = re.compile(r"angular_acc|setpoint|target|desired|command|bias|covariance")
"""Words of names that stand for something else."""
QUATERNION = re.compile(r"(.*_)?(q|quat|quaternion|orientation)_?(?P<axis>[wxyz])")
JOINT = re.compile(
    r"(.*/)?joint_states/(?P<joint>[^/]+)/position|(?P<column>(.*_)?(actual_q|joint|position|q)_?\[?\d\]?)"
)
TIME = re.compile(r"(.*_)?(time|times|timestamp|stamp|t|x_value|elapsed|seconds|epoch)(_s|_ms|_us|_ns)?")
COUNTER = re.compile(r"(.*_)?(packet_?counter|counter|sequence|seq)")
RATE = re.compile(r"(?:rate|frequency)\D{1,20}?(\d+\.?\d*)", re.I)
"""Words of programs on the sample rate, above a table."""
EPOCH = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
"""Least count since 1970 in each unit."""
SLOWEST, FASTEST = 5.0, 20_000.0
"""Sample rates of load cells and IMUs [Hz]."""
GRAVITY = 9.81
TURNING = 20.0
"""Angular velocity that no rig of this kind reaches [rad/s]."""


@dataclass
class _Lines:
    """Keys of a table of the map, each with its reason."""

    keys: list[str] = field(default_factory=list)

    def add(self, key: str, value: Any, why: str) -> None:
        """Write a key."""
        self.keys.append(f"{key} = {toml_value(value)}  # {on_one_line(why)}")


@dataclass(frozen=True)
class Proposal:
    """A map that was written for tables."""

    path: Path
    tables: tuple[Path, ...]
    output: Path
    layouts: tuple[str, ...]
    """Layouts by which the tables were read, for a reader."""

    def __repr__(self) -> str:
        command = f"inertia import {' '.join(map(str, self.tables))} --map {self.path} -o {self.output}"
        lines = [*self.layouts, f"a map is proposed in {self.path}: check every line of it, then: {command}"]
        return "\n".join(map(on_one_line, lines))


def propose(paths: Sequence[str | Path], output: Path) -> Proposal:
    """Write a map for tables beside the run that is asked for, as RUN.map.toml.

    Raises:
        RunError: a table cannot be read, or its names tell no wrench or no motion.
        RigError: there is such a file already, or there are more than two tables.
        OSError: a file cannot be read or written.
    """
    if len(paths) > 2:
        raise RigError(f"{len(paths)} tables: give one, or two that are joined by their times")
    target = output.with_suffix(".map.toml")
    tables = [_Guess(Path(path)) for path in paths]
    _check(tables)
    recording = _Lines()
    recording.add("wrench", "on_body", "a guess: on_sensor, if it is the reaction; inertia inspect tells a wrong sign")
    text = [f"# Proposed for {' and '.join(on_one_line(table.path.name) for table in tables)}: check every line."]
    if len(tables) > 1:
        tables[1].leave(tables[0])
    for name, table in zip(("columns", "second"), tables, strict=False):
        if not table.signals:
            raise RunError(
                f"no column of {table.path.name} is needed, or known by its name: leave it out, or write a map"
            )
        lines = table.columns()
        table.units(recording)
        text += ["", f"[{name}]", *lines.keys]
    text += ["", "[recording]", *recording.keys]
    text += [
        "# add wrench_rotation_to_body, imu_rotation_to_body and wrench_point if they are not the body's axes and Q"
    ]
    with replacing(target, overwrite=False) as stream:
        stream.write(("\n".join(text) + "\n").encode())
    return Proposal(target, tuple(table.path for table in tables), output, tuple(table.told for table in tables))


def _check(tables: list["_Guess"]) -> None:
    names = " and ".join(table.path.name for table in tables)
    for signals, needed, cure in (
        (WRENCH, "force and moment", "give the load cell's table as well"),
        (MOTIONS, "motion", "give the IMU's table as well"),
    ):
        if not any(signal in table.signals for table in tables for signal in signals):
            held = listed(name for table in tables for name in table.layout.written)
            raise RunError(f"no columns of {needed} among those of {names} ({held}): {cure}, or write a map")


class _Guess:
    """Meaning that the columns of one table may have."""

    def __init__(self, path: Path) -> None:
        self.path, self.layout = path, layout(path)
        self.plain = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in self.layout.names]
        self.signals: dict[str, list[int]] = {}
        self.others: dict[str, str] = {}
        self.why = "by its name"
        self.names: dict[str, str] = {}
        if self.layout.named:
            self._by_name()
        elif len(self.layout.names) >= 10:
            self._by_order()
        self.table = CsvTable(path.name, self.layout, self.signals, read_rows(path, self.layout))

    @property
    def told(self) -> str:
        """Layout by which the table was read."""
        delimiter = {"\t": "tab", " ": "blanks"}.get(self.layout.delimiter, self.layout.delimiter)
        rows = f"numbers from line {self.layout.first} on"
        units = ", units stated" if any(self.layout.units) else ""
        marks = f"delimiter {delimiter}, decimal mark {self.layout.decimal}"
        return f"{self.path.name}: {self.layout.encoding}, {marks}, {rows}{units}"

    def leave(self, other: "_Guess") -> None:
        """Leave wrench or motion to another table that has it."""
        for signals in (WRENCH, (*MOTIONS, "acceleration")):
            if any(signal in other.signals for signal in signals):
                for signal in signals:
                    self.signals.pop(signal, None)

    def columns(self) -> _Lines:
        """Return the keys of ``[columns]``."""
        lines = _Lines()
        self._time(lines)
        for signal, places in self.signals.items():
            columns = [self.layout.written[place] for place in places]
            more = f"; there is {self.others[signal]}, too" if signal in self.others else ""
            if signal == "quaternion":
                lines.add(
                    signal,
                    dict(zip("wxyz", columns, strict=True)),
                    f"{self.why}; from the body's frame to one at rest, z up{more}",
                )
            elif signal == "joints":
                lines.add(signal, self.names, "by their names; left of each = the joint's name in the URDF")
                lines.add("joint_unit", "rad", "a guess")
            else:
                lines.add(signal, columns, f"{self.why}{more}")
        return lines

    def units(self, lines: _Lines) -> None:
        """Add the units of the table's signals."""
        counts = {kind: (unit, count) for kind, unit, count in COUNTS.findall(self.layout.preamble)}
        for signal, si in UNITS.items():
            if signal not in self.signals:
                continue
            key, stated = f"{signal}_unit", self.layout.unit(self.signals[signal], si)
            if counts and signal in ("force", "moment"):
                unit, count = counts["Force" if signal == "force" else "Torque"]
                lines.keys.append(f"# {key}: the table states {float(count):,.10g} counts in a {unit}")
            elif stated:
                lines.add(key, stated, "as the table states")
            else:
                lines.add(key, *self._guessed_unit(signal))

    def _by_name(self) -> None:
        groups: dict[tuple[str, str], dict[str, int]] = {}
        for place, name in enumerate(self.plain):
            for signal, words in AXES.items():
                match = re.fullmatch(rf"(?P<before>(?:.*_)?(?:{words}))_?(?P<axis>[xyz])", name)
                if match and not UNLIKELY.search(name):
                    groups.setdefault((signal, match["before"]), {}).setdefault(match["axis"], place)
                    break
        for (signal, before), axes in groups.items():
            if set(axes) == set("xyz"):
                if signal in self.signals:
                    self.others.setdefault(signal, before)
                else:
                    self.signals[signal] = [axes[axis] for axis in "xyz"]
        if "angular_velocity" not in self.signals:
            self._attitude()

    def _attitude(self) -> None:
        """A quaternion or joints, by which the motion is told where no gyro is."""
        found = {match["axis"]: i for i, name in enumerate(self.plain) if (match := QUATERNION.fullmatch(name))}
        self.signals.pop("acceleration", None)
        if set(found) == set("wxyz"):
            self.signals["quaternion"] = [found[axis] for axis in "wxyz"]
            return
        for place, (name, plain) in enumerate(zip(self.layout.names, self.plain, strict=True)):
            match = JOINT.fullmatch(name) or JOINT.fullmatch(plain)
            if match and not UNLIKELY.search(name):
                self.names[match["joint"] or name] = self.layout.written[place]
                self.signals.setdefault("joints", []).append(place)

    def _by_order(self) -> None:
        """The usual order, where the file names no columns."""
        self.why = "a guess: the file names no columns, this is the usual order"
        first = ("force", "moment", "angular_velocity", "acceleration")
        for k, signal in enumerate(first[: (len(self.layout.names) - 1) // 3]):
            self.signals[signal] = [3 * k + 1, 3 * k + 2, 3 * k + 3]

    def _guessed_unit(self, signal: str) -> tuple[str, str]:
        written = " ".join(dict.fromkeys(self.layout.units[place] for place in self.signals[signal])).strip()
        if written:
            return UNITS[signal], f"a guess: the table says {written}, which is no unit known here; correct it"
        if signal in WRENCH:
            return UNITS[signal], "a guess: the table states none; inertia inspect tells a wrong one"
        values = self.table.numbers(signal)
        sizes = np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1)
        if signal == "acceleration":
            typical = float(np.median(sizes))
            units = ("m/s^2", "g", "mm/s^2", "mg_0")
            nearest = min(units, key=lambda unit: abs(np.log(max(typical, 1e-9) * scale(unit, "m/s^2") / GRAVITY)))
            return nearest, f"its size is mostly {typical:.4g}, that of gravity"
        fastest = float(sizes.max())
        unit = "deg/s" if fastest > TURNING else "rad/s"
        return unit, f"a guess by its size, {fastest:.4g} at most"

    def _time(self, lines: _Lines) -> None:
        stated = RATE.search(self.layout.preamble)
        rate = float(stated[1]) if stated else None
        places = [i for i, name in enumerate(self.plain) if TIME.fullmatch(name)] if self.layout.named else [0]
        places.sort(key=lambda i: "header_stamp" not in self.plain[i])
        for place in places:
            if self._time_keys(lines, place, rate):
                return
        if rate is None:
            lines.add("rate", "? Hz", "the table has no times that could be read: state its sample rate")
        else:
            lines.add("rate", f"{rate:g} Hz", f"as the lines above the table state{self._lost()}")

    def _lost(self) -> str:
        """Lost samples that a counter among the columns tells, which a rate does not."""
        for place, name in enumerate(self.plain):
            if COUNTER.fullmatch(name):
                steps = np.diff(np.asarray(self.table.frame[place], float)) % 2**16
                jumps = int((steps != 1).sum())
                return f"; {self.layout.written[place]} jumps {jumps} times" + ": samples are missing" * (jumps > 0)
        return "; samples that are missing would go unseen"

    def _time_keys(self, lines: _Lines, place: int, rate: float | None) -> bool:
        """Add the time's keys; False: the column holds no times."""
        import pandas as pd

        name, sampled = self.layout.written[place], next(iter(self.signals.values()))[0]
        cells = self.table.frame[place][self.table.frame[sampled].notna()].dropna()
        numbers = pd.to_numeric(cells, errors="coerce").to_numpy(float)
        if not len(numbers):
            return False
        if np.isnan(numbers).all():
            lines.add("time", name, "by its name; dates as text")
            return True
        steps = np.diff(numbers)
        if len(steps) < 2 or not np.isfinite(steps).all() or np.mean(steps >= 0) < 0.9 or not steps.max() > 0:
            return False
        if steps.min() < -0.5 * np.ptp(numbers):
            again = self.layout.first + int(np.argmin(steps)) + 1
            lines.keys.append(f"# time {on_one_line(name)} starts again at row {again}; the rate is that of its steps")
            rate = rate or 1 / (float(np.median(steps)) * scale(self.layout.unit([place], "s") or "s", "s"))
            lines.add("rate", f"{rate:.6g} Hz", f"a guess{self._lost()}")
            return True
        step, unit = float(np.median(steps[steps > 0])), self.layout.unit([place], "s")
        why = "as the table states"
        coarse = bool((steps == 0).any())
        if unit is None:
            mean = float(np.ptp(numbers)) / len(steps)
            unit, why = _time_unit(float(numbers[-1]), mean if coarse else step, rate)
        if unit is None:
            return False
        lines.add("time", name, self.why)
        lines.add("time_unit", unit, why)
        if coarse and (told := rate_of_coarse(np.maximum.accumulate(numbers) * scale(unit, "s"))):
            lines.add(
                "rate", f"{told:g} Hz", "the times are coarser than the samples; the roundest rate that they allow"
            )
        return True


def _time_unit(last: float, step: float, rate: float | None) -> tuple[str | None, str]:
    """The unit of times by their size or their steps, and why; None: of none that fits."""
    for unit, least in EPOCH.items():
        if last > least:
            return unit, "by its size, since 1970"
    for unit in ("s", "ms", "us", "ns"):
        told = 1 / (step * scale(unit, "s"))
        if abs(told / rate - 1) < 0.2 if rate else SLOWEST <= told <= FASTEST:
            return unit, f"a guess by its steps, {told:.4g} Hz"
    return None, ""
