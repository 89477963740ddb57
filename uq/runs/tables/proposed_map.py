"""A map that is proposed for a table: what its names, units and numbers suggest, every guess with its reason."""

import re
import tomllib
from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import without_gravity
from identify.signals.run import RunError, refuse_excess
from rig.atomic_files import replacing
from rig.bags.topics import NEEDS_WRIST
from rig.exceptions import RigError, listed, on_one_line
from uq.experiment.recording_table import UNITS
from uq.files.csv_columns import CsvTable, read_rows
from uq.files.table_layout import layout
from uq.files.toml_text import toml_value
from uq.files.units import scale
from uq.runs.tables.gravity_columns import pointing
from uq.runs.tables.table_map import MOTIONS, WRENCH
from uq.runs.tables.table_samples import counts, rate_of_coarse

AXES = {
    "acceleration": "a|acc|accel|accelerometer|acceleration|specific_force",
    "force": "f|force|forces",
    "moment": "t|m|torque|torques|moment|moments",
    "gravity": "(?<!no_)(?<!without_)(?<!free_)(?:gravity|grav|gravity_vector|grv)",
    "angular_velocity": "w|g|gyr|gyro|gyroscope|omega|angular_velocity|angular_rate|ang_vel|rate",
}
"""Names of signals of three axes in lower case; the first whose name fits takes a column."""
UNLIKELY = re.compile(r"angular_acc|setpoint|target|desired|command|bias|covariance")
"""Words of names that stand for something else."""
QUATERNION = re.compile(r"(.*_)?(q|quat|quaternion|orientation)_?(?P<axis>[wxyz])")
EULER = re.compile(r"(.*_)?(?P<axis>roll|pitch|yaw)(_?(deg|rad))?")
ROTATION_VECTOR = re.compile(
    r"(.*_)?(?:r(?:ot(?:ation)?)?(?:_?vec(?:tor)?)?_?(?P<axis>[xyz])|tcp_pose_(?P<place>[345]))"
)
POSITION = re.compile(r"(.*_)?(?:p(?:os(?:ition)?)?_?(?P<axis>[xyz])|tcp_pose_(?P<place>[012]))")
SIX = re.compile(r"(.*_)?(ft_raw_wrench|tcp_force|wrench|ft)_?(?P<place>[0-5])")
"""Wrenches of six numbered columns, as a robot's recorder names them."""
JOINT = re.compile(r"(.*/)?joint_states/(?P<joint>[^/]+)/position|(.*_)?(actual_q|joint|position|q)_?\[?\d\]?")
TIME = re.compile(r"zeit(_.*)?|(.*_)?(time|times|timestamp|stamp|t|x_value|elapsed|seconds|epoch)(_s|_ms|_us|_ns)?")
COUNTER = re.compile(r"(.*_)?(packet_?counter|counter|sequence|seq)")
RATE = re.compile(r"(?:rate|frequency)\D{1,20}?(\d+\.?\d*)", re.I)
"""Words of programs on the sample rate, above a table."""
WORDS = re.compile(
    r"(?P<time>\btime)|(?P<position>\bposition)|(?P<acceleration>\baccel)|(?P<quaternion>\bquaternion|\borientation)|"
    r"(?P<angular_velocity>\bgyro|\bangular (?:velocity|rate))|(?P<force>\bforce)|(?P<moment>\btorque|\bmoment)", re.I
)  # fmt: skip
"""Words on signals above a table whose columns have no names."""
WIDTHS = {"time": 1, "quaternion": 4}
"""Numbers of columns of signals that have not three."""
WITHOUT_GRAVITY = re.compile(r"gravity.{0,9}(removed|free|compensated)|(without|no) gravity", re.I)
OF_GRAVITY = (
    ": vectors of gravity leave the heading open: give the gyro's table as well, or take `inertia centre`, of rest"
)
SAME = 0.9
"""Correlation of a column's steps with the integral of another from which this is its rate."""
EPOCH = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 1e8}
"""Least count since 1970 in each unit."""
SLOWEST, FASTEST = 5.0, 20_000.0
"""Sample rates of load cells and IMUs [Hz]."""
FARTHEST = 20.0
"""Position that no arm reaches [m]: a larger number is in millimetres."""
GRAVITY = 9.81
TURNING = 20.0
"""Angular velocity that no rig of this kind reaches [rad/s]."""


def propose(paths: Sequence[str | Path], output: Path) -> str:
    """Write a map for tables beside the run that is asked for, as RUN.map.toml.

    Returns:
        How the tables were read, and the command that imports them, for a reader.

    Raises:
        RunError: a table cannot be read, or its names tell no wrench or no motion.
        RigError: there is such a file already, or there are more than two tables.
        OSError: a file cannot be read or written.
    """
    if len(paths) > 2:
        raise RigError(f"{len(paths)} tables: give one, or two that are joined by their times")
    target = output.with_suffix(".map.toml")
    tables = [_Guess(path) for path in paths]
    _check(tables)
    if len(tables) > 1:
        tables[1].leave(tables[0])
    columns: list[str] = []
    recording = [
        _line("wrench", "on_body", "a guess: on_sensor, if it is the reaction; inertia inspect detects a wrong sign")
    ]
    for name, table in zip(("columns", "second"), tables, strict=False):
        if not table.signals:
            raise RunError(
                f"no column of {table.path.name} is needed, or known by its name: leave it out, or write a map"
            )
        columns += [f"[{name}]", *table.columns(), ""]
        recording += table.units()
    text = [
        f"# Proposed for {' and '.join(on_one_line(table.path.name) for table in tables)}: check every line.",
        "", *columns, "[recording]", *recording,
        "# add wrench_rotation_to_body, imu_rotation_to_body and wrench_point if they are not the body's axes and Q",
    ]  # fmt: skip
    with replacing(target, overwrite=False) as stream:
        stream.write(("\n".join(text) + "\n").encode())
    command = f"inertia import {' '.join(str(table.path) for table in tables)} --map {target} -o {output}"
    layouts = [table.layout_text for table in tables]
    return "\n".join(
        map(on_one_line, [*layouts, f"a map is proposed in {target}: check every line of it, then: {command}"])
    )


def _line(key: str, value: Any, why: str) -> str:
    """A key of the map, with its reason."""
    return f"{key} = {toml_value(value)}  # {on_one_line(why)}"


def _check(tables: list["_Guess"]) -> None:
    names = " and ".join(table.path.name for table in tables)
    signals_of_tables = {signal for table in tables for signal in table.signals}
    held = f" ({listed(name for table in tables for name in table.written)})"
    lean = any(table.lean for table in tables)
    for signals, needed, cure in (
        (WRENCH, "force and moment", f": give the load cell's table as well, or write a map; {NEEDS_WRIST}"),
        (MOTIONS, "motion", OF_GRAVITY if lean else f"{held}: give the IMU's table as well, or write a map"),
    ):
        if signals_of_tables.isdisjoint(signals):
            raise RunError(f"no columns of {needed} among those of {names}{cure}")


class _Guess:
    """Meaning that the columns of one table may have."""

    def __init__(self, path: str | Path) -> None:
        self.layout = layout(path)
        self.path, self.written = self.layout.path, self.layout.written
        self.plain = [re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") for name in self.layout.names]
        self.signals: dict[str, list[int]] = {}
        self.others: dict[str, str] = {}
        """Another group of columns that could be the signal."""
        self.joints: dict[str, str] = {}
        self.why = "by its name"
        self.table = CsvTable(self.layout, self.signals, read_rows(self.layout))
        if self.layout.named:
            self._by_name()
        elif not (self._by_words() or self._by_rates()) and len(self.written) >= 10:
            self._by_order()
        self.lean = "gravity" in self.signals
        """Whether the table has vectors of gravity."""
        if self.lean and not self._without_gravity:
            del self.signals["gravity"]  # nothing that it could be put back to

    @property
    def layout_text(self) -> str:
        """Layout by which the table was read."""
        delimiter = {"\t": "tab", " ": "blanks"}.get(self.layout.delimiter, self.layout.delimiter)
        rows = f"numbers from line {self.layout.first} on"
        units = ", units stated" if any(self.layout.units) else ""
        marks = f"delimiter {delimiter}, decimal mark {self.layout.decimal}"
        return f"{self.path.name}: {self.layout.encoding}, {marks}, {rows}{units}"

    def leave(self, other: "_Guess") -> None:
        """Leave wrench or motion to another table that has it."""
        for signals in (WRENCH, (*MOTIONS, "acceleration", "gravity")):
            if not other.signals.keys().isdisjoint(signals):
                for signal in signals:
                    self.signals.pop(signal, None)

    def columns(self) -> Iterator[str]:
        """Return the lines of ``[columns]``."""
        yield from self._time()
        for signal, places in self.signals.items():
            columns = [self.written[place] for place in places]
            if signal == "joints":
                yield _line(signal, self.joints, f"{self.why}; left of each = the joint's name in the URDF")
                yield _line("joint_unit", "rad", "a guess")
            elif signal == "quaternion":
                named = dict(zip("wxyz", columns, strict=True))
                order = "" if self.layout.named else ", a guess: w last, which inertia inspect judges"
                yield _line(signal, named, f"{self.why}{order}; from the body's frame to one at rest, z up")
            elif signal in ("euler", "rotation_vector"):
                yield _line(signal, columns, f"{self.why}; from the body's frame to one at rest, z up")
                yield from self._angles(signal)
            elif signal == "position":
                yield _line(signal, columns, self.why)
                stated, largest = self.layout.unit(places, "m"), float(np.nanmax(np.abs(self._numbers(signal))))
                why = "as the table states" if stated else f"a guess by their size, {largest:.4g} at most"
                yield _line("position_unit", stated or ("mm" if largest > FARTHEST else "m"), why)
            elif signal == "gravity":
                yield _line(signal, columns, f"{self.why}; put back where it was taken out of the acceleration")
                yield _line("gravity_points", *self._gravity_points())
            else:
                more = f"; there is {self.others[signal]}, too" if signal in self.others else ""
                yield _line(signal, columns, f"{self.why}{more}")

    def _gravity_points(self) -> tuple[str, str]:
        """The end to which the vectors of gravity point, and why."""
        signals = "force", "acceleration", "gravity"
        points = None
        if self.signals.keys() >= set(signals):
            rows = np.hstack([self._numbers(signal) for signal in signals])
            points = pointing(*np.hsplit(rows[np.isfinite(rows).all(axis=1)], 3))
        return points or "down", "by the force" if points else "a guess, which import checks by the force"

    def _angles(self, signal: str) -> Iterator[str]:
        """Return the lines of what angles mean."""
        values = self._numbers(signal)
        named = "deg" if any(self.plain[place].endswith("deg") for place in self.signals[signal]) else ""
        largest = float(np.nanmax(np.abs(values)))
        unit = named or ("deg" if largest > 2 * np.pi else "rad")
        if signal == "euler":
            yield _line("euler_convention", "rpy", "a guess by their names; inertia inspect judges it by the weight")
        yield _line("angle_unit", unit, "by its name" if named else f"a guess by their size, {largest:.4g} at most")
        yield _line("takes", "sensor_to_level", "a guess; inertia inspect detects the other way")

    def units(self) -> Iterator[str]:
        """Return the lines of the units of the table's signals."""
        counted = counts(self.layout.preamble)
        for signal, si in UNITS.items():
            if signal not in self.signals:
                continue
            key, stated = f"{signal}_unit", self.layout.unit(self.signals[signal], si)
            if signal in counted:
                count, unit = counted[signal]
                yield f"# {key}: the table states {count:,.10g} counts in a {unit}"
            elif stated:
                yield _line(key, stated, "as the table states")
            else:
                yield _line(key, *self._guessed_unit(signal))
        if self._without_gravity:
            why = "read at rest: gravity was taken out, which vectors of gravity or a quaternion in the table put back"
            yield _line("accelerometer_at_rest", "zero", why)

    @cached_property
    def _without_gravity(self) -> bool:
        """Whether the acceleration holds no gravity, by the gyro; not judged without numbers for times."""
        import pandas as pd

        if not {"acceleration", "angular_velocity"} <= self.signals.keys():
            return False
        lines = tomllib.loads("\n".join(self._time()))
        if "time_unit" in lines:
            cells = self.table.frame[self.written.index(lines["time"])]
            time = pd.to_numeric(cells, errors="coerce").to_numpy(float) * scale(lines["time_unit"], "s")
        elif "time" in lines or not lines["rate"].removesuffix(" Hz").replace(".", "").isdigit():
            return False
        else:
            time = np.arange(len(self.table.frame)) / float(lines["rate"].removesuffix(" Hz"))
        rows = np.column_stack([time, *(self._numbers(name) for name in ("angular_velocity", "acceleration"))])
        rows = rows[np.isfinite(rows).all(axis=1)]
        rate = self.layout.unit(self.signals["angular_velocity"], "rad/s") or self._guessed_unit("angular_velocity")[0]
        return without_gravity(ImuSignal(rows[:, 0], rows[:, 1:4] * scale(rate, "rad/s"), rows[:, 4:]))

    def _by_name(self) -> None:
        groups: dict[tuple[str, str], dict[str, int]] = {}
        for place, name in enumerate(self.plain):
            for signal, words in AXES.items():
                match = re.fullmatch(rf"(?P<before>(?:.*_)?(?:{words}))_?(?P<axis>[xyz])(?:_\d+)?", name)
                if match and not UNLIKELY.search(name):
                    groups.setdefault((signal, match["before"]), {}).setdefault(match["axis"], place)
                    break
        for (signal, before), axes in groups.items():
            if set(axes) == set("xyz"):
                if signal in self.signals:
                    self.others.setdefault(signal, before)
                else:
                    self.signals[signal] = [axes[axis] for axis in "xyz"]
        for signal in [signal for signal in self.signals if self._constant(signal)]:
            del self.signals[signal]  # nothing measures it
        if self.signals.keys().isdisjoint(WRENCH) and len(six := self._matched(SIX, "place")) == 6:
            self.signals |= {"force": six[:3], "moment": six[3:]}
        self._attitude()

    def _numbers(self, signal: str) -> np.ndarray:
        """Return the numbers of a signal, none of which is beyond any sensor."""
        values = self.table.numbers(signal)
        refuse_excess(signal, values, self.path.name)
        return values

    def _constant(self, signal: str) -> bool:
        """Whether columns that are named like a signal never change."""
        try:
            values = self._numbers(signal)
        except RunError:
            return False
        values = values[np.isfinite(values).all(axis=1)]
        return len(values) > 1 and not np.ptp(values, axis=0).any()

    def _matched(self, pattern: re.Pattern[str], *groups: str) -> list[int]:
        """Places of the columns whose names a pattern knows, in the order of what its group names."""
        places: dict[str, int] = {}
        for place, name in enumerate(self.plain):
            if (match := pattern.fullmatch(name)) and not UNLIKELY.search(name):
                places.setdefault(next(filter(None, map(match.group, groups))), place)
        return [places[key] for key in sorted(places)]

    def _attitude(self) -> None:
        """A quaternion; where there is neither this nor a gyro, joints."""
        components = {match["axis"]: i for i, name in enumerate(self.plain) if (match := QUATERNION.fullmatch(name))}
        if "angular_velocity" not in self.signals:
            self.signals.pop("acceleration", None)
        quaternion = [components[axis] for axis in "wxyz"] if set(components) == set("wxyz") else []
        angles = self._matched(EULER, "axis")  # sorted: pitch, roll, yaw
        euler = [angles[1], angles[0], angles[2]] if len(angles) == 3 else []
        vector = self._matched(ROTATION_VECTOR, "axis", "place")
        turned = (
            self._moves("quaternion", quaternion) or self._moves("euler", euler)
            or self._moves("rotation_vector", vector if len(vector) == 3 else [])
        )  # fmt: skip
        if turned and "angular_velocity" not in self.signals:
            at = self._matched(POSITION, "axis", "place")
            self._moves("position", at if len(at) == 3 else [])
        if not self.signals.keys().isdisjoint(MOTIONS):
            return
        for place, (name, plain) in enumerate(zip(self.layout.names, self.plain, strict=True)):
            match = JOINT.fullmatch(name) or JOINT.fullmatch(plain)
            if match and not UNLIKELY.search(name):
                self.joints[match["joint"] or name] = self.written[place]
                self.signals.setdefault("joints", []).append(place)

    def _moves(self, signal: str, places: list[int]) -> bool:
        """Take columns for a signal, unless there are none or they never change; whether they are taken."""
        self.signals[signal] = places
        if not places or self._constant(signal):
            del self.signals[signal]
        return signal in self.signals

    def _by_words(self) -> bool:
        """Signals in the order in which the lines above name them, where their columns then are all that there are."""
        places = iter(range(len(self.written) + 1))
        words = dict.fromkeys(str(match.lastgroup) for match in WORDS.finditer(self.layout.preamble))
        signals = {word: list(islice(places, WIDTHS.get(word, 3))) for word in words}
        if list(places) != [len(self.written)]:
            return False
        self.why = "by the order of the words above the table"
        if "quaternion" in signals:
            signals["quaternion"].insert(0, signals["quaternion"].pop())
        if WITHOUT_GRAVITY.search(self.layout.preamble):
            signals.pop("acceleration", None)  # no specific force
        self.signals |= {signal: signals[signal] for signal in signals if signal in (*UNITS, "quaternion")}
        return True

    def _by_rates(self) -> bool:
        """Joints: columns whose rates are as many columns behind them."""
        import pandas as pd

        t, *columns = self.table.frame.apply(pd.to_numeric, errors="coerce").to_numpy(float).T
        for count in range(len(columns) // 2, 2, -1):
            pairs = [(columns[k], columns[k + count]) for k in range(count)]
            if all(_is_rate(t, position, rate) for position, rate in pairs):
                self.signals["joints"] = list(range(1, count + 1))
                self.joints = {f"joint_{k}": self.written[k] for k in range(1, count + 1)}
                self.why = f"a guess: their rates stand {count} columns behind them"
                return True
        return False

    def _by_order(self) -> None:
        """The usual order, where the file names no columns."""
        self.why = "a guess: the file names no columns, this is the usual order"
        for k, signal in enumerate(UNITS):
            if 3 * k + 3 < len(self.written):
                self.signals[signal] = [3 * k + 1, 3 * k + 2, 3 * k + 3]

    def _guessed_unit(self, signal: str) -> tuple[str, str]:
        written = " ".join(dict.fromkeys(self.layout.units[place] for place in self.signals[signal])).strip()
        if written:
            return UNITS[signal], f"a guess: the table says {written}, which is no unit known here; correct it"
        if signal in WRENCH:
            return UNITS[signal], "a guess: the table states none; inertia inspect detects a wrong one"
        values = self._numbers(signal)
        sizes = np.linalg.norm(values[np.isfinite(values).all(axis=1)], axis=1)
        if signal == "acceleration" and self._without_gravity:
            return UNITS[signal], "a guess: without gravity nothing tells its unit"
        if signal == "acceleration":
            typical = float(np.median(sizes))
            units = ("m/s^2", "g", "mm/s^2", "mg_0")
            nearest = min(units, key=lambda unit: abs(np.log(max(typical, 1e-9) * scale(unit, "m/s^2") / GRAVITY)))
            return nearest, f"its size is mostly {typical:.4g}, that of gravity"
        fastest = float(sizes.max())
        unit = "deg/s" if fastest > TURNING else "rad/s"
        return unit, f"a guess by its size, {fastest:.4g} at most"

    def _time(self) -> list[str]:
        """The lines of the time, or of the rate."""
        stated = RATE.search(self.layout.preamble)
        rate = float(stated[1]) or None if stated else None
        places = [i for i, name in enumerate(self.plain) if TIME.fullmatch(name)] if self.layout.named else [0]
        places.sort(key=lambda i: "header_stamp" not in self.plain[i])
        for place in places:
            if lines := self._time_of(place, rate):
                return lines
        if rate is None:
            return [_line("rate", "? Hz", "the table has no times that could be read: state its sample rate")]
        return [_line("rate", f"{rate:g} Hz", f"as the lines above the table state{self._lost()}")]

    def _lost(self) -> str:
        """Lost samples that a counter among the columns tells, which a rate does not."""
        for place, name in enumerate(self.plain):
            if COUNTER.fullmatch(name):
                steps = np.diff(np.asarray(self.table.frame[place], float)) % 2**16
                jumps = int((steps != 1).sum())
                return f"; {self.written[place]} jumps {jumps} times" + ": samples are missing" * (jumps > 0)
        return "; samples that are missing would go unseen"

    def _time_of(self, place: int, rate: float | None) -> list[str]:
        """The lines of the time in a column; []: it holds no times."""
        import pandas as pd

        name, sampled = self.written[place], next(iter(self.signals.values()))[0]
        cells = self.table.frame[place][self.table.frame[sampled].notna()].dropna()
        times = pd.to_numeric(cells, errors="coerce").to_numpy(float)
        if len(times) and np.isnan(times).all():
            return [_line("time", name, "by its name; dates as text")]
        steps = np.diff(times)
        if len(steps) < 2 or not np.isfinite(steps).all() or np.mean(steps >= 0) < 0.9 or not steps.max() > 0:
            return []
        unit, why = self.layout.unit([place], "s"), "as the table states"
        if steps.min() < -0.5 * np.ptp(times):
            again = self.layout.first + int(np.argmin(steps)) + 1
            step = float(np.median(steps)) * scale(unit or "s", "s")
            rate = rate or (1 / step if step > 0 else None)
            return [
                f"# time {on_one_line(name)} starts again at row {again}; the rate is that of its steps",
                _line("rate", f"{rate:.6g} Hz" if rate else "? Hz", f"a guess{self._lost()}" if rate else "state it"),
            ]
        coarse = bool((steps == 0).any())
        if unit is None:
            step = np.ptp(times) / len(steps) if coarse else np.median(steps[steps > 0])
            unit, why = _time_unit(float(times[-1]), float(step), rate)
        if unit is None:
            return []
        lines = [_line("time", name, self.why), _line("time_unit", unit, why)]
        if coarse:
            roundest = rate_of_coarse(np.maximum.accumulate(times) * scale(unit, "s"))
            why = (
                "the roundest that they allow" if roundest else "state it" if rate is None else "as the lines above say"
            )
            value = f"{roundest or rate:g} Hz" if roundest or rate else "? Hz"
            lines.append(_line("rate", value, f"the times are coarser than the samples, whose rate this is: {why}"))
        return lines


def _is_rate(t: np.ndarray, position: np.ndarray, rate: np.ndarray) -> bool:
    """Whether a column is the rate of another, both of which change."""
    steps = np.diff(t)
    if not (steps > 0).all() or not (np.isfinite(position).all() and np.isfinite(rate).all()):
        return False
    travelled, integrated = np.diff(position), 0.5 * (rate[1:] + rate[:-1]) * steps
    size = float(np.sqrt((travelled**2).sum() * (integrated**2).sum()))
    return size > 0 and float(travelled @ integrated) > SAME * size


def _time_unit(last: float, step: float, rate: float | None) -> tuple[str | None, str]:
    """The unit of times by their size or their steps, and why; None: of none that fits."""
    for unit, least in EPOCH.items():
        if last > least:
            return unit, "by its size, since 1970"
    for unit in ("s", "ms", "us", "ns"):
        step_rate = 1 / (step * scale(unit, "s"))
        if abs(step_rate / rate - 1) < 0.2 if rate else SLOWEST <= step_rate <= FASTEST:
            return unit, f"a guess by its steps, {step_rate:.4g} Hz"
    return None, ""
