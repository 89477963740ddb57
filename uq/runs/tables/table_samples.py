"""The samples of a declared table: instants, complete rows of numbers, and these as a recording."""

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
import scipy

from identify.display.text_tables import counted
from identify.signals.run import RunError
from rig import channels
from rig.channels import ImuChannel, WrenchChannel
from rig.exceptions import quoted
from rig.record.device_clock import roundest
from uq.experiment.recording_table import UNITS, RecordingTable
from uq.files.csv_columns import CsvTable, read_columns
from uq.files.mistakes import ExperimentError
from uq.files.provenance import sha256
from uq.files.table_layout import known_unit
from uq.files.units import scale
from uq.runs.recorded.declared_channels import EQUAL
from uq.runs.tables.table_map import MapColumns

if TYPE_CHECKING:
    import pandas as pd


NANOSECONDS = 1_000_000_000
LATEST = 9e9
"""Seconds since 1970 that no recording reaches."""
COUNTS = re.compile(r"(Force|Torque) Units:\s*([^,\s]+)\s*,\s*Counts per Unit (?:Force|Torque):\s*([\d.eE+]+)")
"""Line of ATI's software above a table of counts: the unit, and how many counts it is."""
ATI_TIME = "%m/%d/%Y %I:%M:%S.%f %p"
"""Times as that software writes them; without their form each would be parsed by itself, in a minute for a million."""
DURATION = re.compile(r"\s*[-+]?[\d.]+\s*(days?|hours?|hr|min|sec|s|ms|us)\b")
"""Beginning of a time since the start with its unit, as MATLAB and pandas write durations."""
SIGNALS = {"Force": "force", "Torque": "moment"}


class TableSamples(NamedTuple):
    """The rows of a table that hold all numbers of some signals."""

    stamp: np.ndarray
    """Instants of the rows [ns], (n,)."""
    values: list[np.ndarray]
    """Numbers of each signal in its unit, (n, columns)."""
    notes: list[str]
    """Notes on rows that are left out or sorted."""


class DeclaredTable:
    """A table with the meaning of its columns."""

    def __init__(self, path: str | Path, columns: MapColumns) -> None:
        self.path, self.declared = Path(path), columns
        self.table: CsvTable = read_columns(path, columns.columns)
        self._counts = counts(self.table.layout.preamble)

    def unit(self, signal: str, key: str, declared: str | None) -> str | None:
        """Return the unit of a signal: the map's, or that which the table states; None: neither states one.

        Args:
            signal: its key in ``[columns]``.
            key: the map's key of the unit.
            declared: what the map says there.

        Raises:
            ExperimentError: map and table contradict each other.
        """
        si, name = UNITS.get(signal, "s"), "times" if signal == "time" else signal.replace("_", " ")
        if signal in self._counts:
            stated = known_unit(self._counts[signal][1], si)
        else:
            stated = self.table.layout.unit(self.table.places[signal], si)
        if declared and stated and abs(scale(declared, si) / scale(stated, si) - 1) > EQUAL:
            raise ExperimentError(f"{self.path.name} states {name} in {stated}, {key} says {declared}: correct the map")
        return declared or stated

    def samples(self, signals: Sequence[str]) -> TableSamples:
        """Return the rows that hold all of some signals.

        Raises:
            RunError: there are fewer than two, or a cell is no number.
            ExperimentError: the time's unit is unknown.
        """
        values = [self.table.numbers(signal) / self._counts.get(signal, (1.0, ""))[0] for signal in signals]
        start, seconds = self._clock
        complete = np.isfinite(np.column_stack([seconds, *values])).all(axis=1)
        if complete.sum() < 2:
            raise RunError(f"fewer than two rows of {self.path.name} hold {' and '.join(signals)}: name other columns")
        stamp = start + np.round(seconds[complete] * NANOSECONDS).astype(np.int64)
        if np.diff(stamp).min() < -0.5 * np.ptp(stamp):  # before messages that overtook others are sorted
            again = int(np.argmin(np.diff(stamp))) + 1
            raise RunError(
                f"time in {self.path.name} starts again after sample {again}: write rate instead of time, "
                "or split the table"
            )
        notes = []
        if (np.diff(stamp) < 0).any():
            notes.append("rows out of order are sorted by their times")
        if missing := int((~complete).sum()):
            notes.append(f"{counted(missing, 'row')} of {self.path.name} without {' or '.join(signals)} left out")
        return TableSamples(stamp, [array[complete] for array in values], notes)

    def check_order(self, stamp: np.ndarray) -> None:
        """Refuse instants that do not increase.

        Raises:
            RunError: so it is.
        """
        steps = np.diff(stamp)
        if (steps > 0).all():
            return
        cure = "correct the table, or write rate, the sample rate, in place of time"
        if (steps >= 0).all() and (rate := rate_of_coarse(stamp * 1e-9)):
            cure = f'its steps are coarser than the samples, which come at {rate:g} Hz: add rate = "{rate:g} Hz"'
        raise RunError(
            f"time in {self.path.name} does not increase after sample {int(np.argmax(steps <= 0)) + 1}: {cure}"
        )

    @cached_property
    def _clock(self) -> tuple[int, np.ndarray]:
        """Instant of the first row [ns], from 1970 or another zero, and seconds of each row since then, NaN for none.

        They are apart, since nanoseconds since 1970 have more digits than a double.
        """
        start = round((self.declared.time_offset or 0.0) * NANOSECONDS)
        uniform = np.arange(len(self.table.frame)) / (self.declared.rate or 1.0)
        if self.declared.time is None:
            return start, uniform
        first, seconds = self._times()
        if self.declared.rate is None:
            return start + first, seconds
        self._check_rate(seconds, uniform)
        return start + first, uniform

    def _check_rate(self, seconds: np.ndarray, uniform: np.ndarray) -> None:
        """Refuse a rate that coarse times contradict: samples are missing, or the rate is another."""
        finite = seconds[np.isfinite(seconds)]
        off = finite - uniform[np.isfinite(seconds)]
        if np.ptp(off) > 1.01 * _resolution(finite) + 1e-9:
            mean = (len(off) - 1) / np.ptp(finite)
            raise RunError(
                f"times in {self.path.name} depart by {np.ptp(off):.3g} s from {self.declared.rate:g} Hz: correct rate "
                f"(the times suggest about {mean:.6g} Hz), or the table, which may lack samples"
            )

    def _times(self) -> tuple[int, np.ndarray]:
        """Instant of the first row [ns], and seconds of each since then."""
        import pandas as pd

        name, cells = self.path.name, self.table.frame[self.table.places["time"][0]]
        times = pd.to_numeric(cells, errors="coerce")
        if times.isna().all() and cells.notna().any():
            times = _dates(cells, name, self.table.layout.first)
            unit: str | None = "ns"
        else:
            self.table.numbers("time")  # it says which cell is no number
            unit = self.unit("time", "columns.time_unit", self.declared.time_unit)
        if unit is None:
            raise ExperimentError('columns.time_unit belongs to a time column: add it, such as time_unit = "s"')
        numbered = times.dropna()
        if not len(numbered):
            raise RunError(f"no times in column {quoted(str(self.declared.time))} of {name}: write rate instead")
        factor, start = scale(unit, "s"), numbered.iloc[0]
        if (float(numbered.max()) - min(float(numbered.min()), 0.0)) * factor > LATEST:
            last = float(numbered.iloc[-1]) * factor
            raise RunError(f"time in {name} reaches {last:.3g} s: correct columns.time_unit")
        nanoseconds = round(factor * NANOSECONDS)
        exact = nanoseconds >= 1 and isinstance(start, (int, np.integer))
        first = int(start) * nanoseconds if exact else round(float(start) * factor * NANOSECONDS)
        return first, np.asarray((times - start) * factor, float)


def counts(preamble: str) -> dict[str, tuple[float, str]]:
    """Return counts in a unit, and this unit as it is written, of force and moment; {}: a table holds no counts.

    Args:
        preamble: the lines above the table.
    """
    return {SIGNALS[kind]: (float(count), unit) for kind, unit, count in COUNTS.findall(preamble)}


def rate_of_coarse(t: np.ndarray) -> float | None:
    """Return the sample rate [Hz] that repeated, coarse times tell: the roundest within their resolution.

    Args:
        t: times that do not decrease [s], (n,).
    """
    edges = np.flatnonzero(np.diff(t) > 0)
    if len(t) < 10 or len(edges) < 2:  # one step tells no period
        return None
    tick, index = _resolution(t), np.unique([0, *edges, *edges + 1, len(t) - 1])
    # The period p of samples at k p whose times are cut or rounded to the tick: all t - k p lie within one tick.
    low, high = _within(t[index], index.astype(float), tick)
    if low > high:  # samples are missing: the table is refused by this rate
        span = t[-1] - t[0]
        low, high = (span - tick) / (len(t) - 1), (span + tick) / (len(t) - 1)
    return roundest(2 / (low + high), 1 / high, 1 / max(low, 1e-12))


def _within(t: np.ndarray, index: np.ndarray, tick: float) -> tuple[float, float]:
    """Least and largest period p for which all t - index p lie within a tick [s]; least > largest: there is none."""

    def excess(period: float) -> float:
        return float(np.ptp(t - index * period)) - tick * (1 + 1e-6)

    mean, reach = (t[-1] - t[0]) / index[-1], 2 * tick / index[-1]
    ends = max(mean - reach, 0.0), mean + reach
    best = scipy.optimize.minimize_scalar(excess, bounds=ends, method="bounded", options={"xatol": 1e-9 * mean}).x
    if excess(best) > 0:
        return ends[1], ends[0]
    low, high = (end if excess(end) <= 0 else scipy.optimize.brentq(excess, end, best) for end in ends)
    return low, high


def _resolution(t: np.ndarray) -> float:
    """Resolution of times of which some repeat: their usual step, which no gap changes."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def _dates(cells: "pd.Series", name: str, first: int) -> "pd.Series":
    """Nanoseconds since 1970 of dates or times of day as text; those without a zone count as universal time."""
    import pandas as pd
    from pandas.tseries.api import guess_datetime_format

    if DURATION.match(str(cells.dropna().iloc[0])):
        since = pd.to_timedelta(cells, errors="coerce")
        if since.notna().sum() == cells.notna().sum():
            return since.dt.as_unit("ns").astype("int64").where(since.notna())
    guess = guess_datetime_format(str(cells.dropna().iloc[0]))
    for form in filter(None, ("ISO8601", ATI_TIME, guess, "mixed")):
        try:
            dates = pd.to_datetime(cells, format=form, utc=True)
        except (ValueError, TypeError):
            continue
        return dates.dt.as_unit("ns").astype("int64").where(dates.notna())
    raise RunError(
        f"time in {name} is {quoted(str(cells.iloc[0]))} at row {first}: write seconds, or dates as ISO 8601"
    )


def silenced(recording: RecordingTable, quantities: set[str]) -> RecordingTable:
    """Return the declaration with a unit for quantities that a table lacks, so that nothing is assumed of them."""
    units: dict[str, Any] = {f"{name}_unit": recording.unit(name) or UNITS[name] for name in quantities}
    return msgspec.structs.replace(recording, **units)


def as_recording(
    path: str | Path, force: np.ndarray, moment: np.ndarray, omega: np.ndarray, acceleration: np.ndarray
) -> channels.Recording:
    """Return a table's columns as a recording without metadata."""
    times = np.arange(len(force))
    wrench = WrenchChannel(
        topic="force and moment", frame_id="", log_time=times, stamp=times, force=force, moment=moment
    )
    imu = ImuChannel(
        topic="angular velocity and acceleration", frame_id="", log_time=times, stamp=times, angular_velocity=omega,
        linear_acceleration=acceleration,
    )  # fmt: skip
    return channels.Recording(Path(path), sha256(path), {}, wrench, imu)
