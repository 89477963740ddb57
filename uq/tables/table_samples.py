"""The samples of a declared table: instants, complete rows of numbers, and these as a recording."""

import re
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np

from identify.signals.run import RunError
from rig import channels
from rig.channels import ImuChannel, WrenchChannel
from rig.exceptions import quoted
from uq.experiment.recording_table import UNITS, RecordingTable
from uq.files.csv_columns import CsvTable, read_columns
from uq.files.document import ExperimentError
from uq.files.provenance import sha256
from uq.files.table_layout import known_unit
from uq.files.units import scale
from uq.tables.table_map import MapColumns

if TYPE_CHECKING:
    import pandas as pd


NANOSECONDS = 1_000_000_000
LATEST = 9e9
"""Seconds since 1970 that no recording reaches."""
COUNTS = re.compile(r"(Force|Torque) Units:\s*([^,\s]+)\s*,\s*Counts per Unit (?:Force|Torque):\s*([\d.eE+]+)")
"""Line of ATI's software above a table of counts: the unit, and how many counts it is."""
ATI_TIME = "%m/%d/%Y %I:%M:%S.%f %p"
"""Times as that software writes them; without their form each would be parsed by itself, in a minute for a million."""
SIGNALS = {"Force": "force", "Torque": "moment"}


class TableSamples(NamedTuple):
    """The rows of a table that hold all numbers of some signals."""

    stamp: np.ndarray
    """Instants of the rows [ns], (n,)."""
    values: list[np.ndarray]
    """Numbers of each signal as they stand in the table, (n, columns)."""
    notes: tuple[str, ...]
    """Notes on the rows that are left out."""


class DeclaredTable:
    """A table with the meaning of its columns."""

    def __init__(self, path: str | Path, columns: MapColumns) -> None:
        self.path, self.declared = Path(path), columns
        self.table: CsvTable = read_columns(path, columns.columns)
        stated = COUNTS.findall(self.table.layout.preamble)
        self.counts = {SIGNALS[kind]: float(count) for kind, _, count in stated}
        """Counts in a unit of force and moment, where the table says that it holds counts."""
        self._units = {SIGNALS[kind]: unit for kind, unit, _ in stated}

    def unit(self, signal: str) -> str | None:
        """Return the unit of a signal that the table states; None: it states none."""
        si = UNITS.get(signal, "s")
        if signal in self._units:
            return known_unit(self._units[signal], si)
        return self.table.layout.unit(self.table.places[signal], si)

    def samples(self, signals: Sequence[str]) -> TableSamples:
        """Return the rows that hold all of some signals.

        Raises:
            RunError: there are fewer than two, or a cell is no number.
            ExperimentError: the time's unit is unknown.
        """
        values = [self.table.numbers(signal) for signal in signals]
        complete = np.isfinite(np.hstack([self._seconds[:, None], *values])).all(axis=1)
        if complete.sum() < 2:
            raise RunError(f"fewer than two rows of {self.path.name} hold {' and '.join(signals)}: name other columns")
        missing = int((~complete).sum())
        notes = (f"{missing:,} rows of {self.path.name} without {' or '.join(signals)} are left out",) * (missing > 0)
        stamp = self._stamps[complete]
        if np.diff(stamp).min() < -0.5 * np.ptp(stamp):  # before messages that overtook others are sorted
            again = int(np.argmin(np.diff(stamp))) + 1
            raise RunError(
                f"time in {self.path.name} starts again after sample {again}: write rate instead of time, "
                "or split the table"
            )
        return TableSamples(stamp, [array[complete] for array in values], notes)

    def check_order(self, stamp: np.ndarray) -> None:
        """Refuse instants that do not increase.

        Raises:
            RunError: so it is.
        """
        steps = np.diff(stamp)
        if (steps > 0).all():
            return
        cure = "correct the table"
        if (steps >= 0).all() and (rate := rate_of_coarse(stamp * 1e-9)):
            cure = f'its steps are coarser than the samples, which come at {rate:g} Hz: add rate = "{rate:g} Hz"'
        raise RunError(
            f"time in {self.path.name} does not increase after sample {int(np.argmax(steps <= 0)) + 1}: {cure}"
        )

    @cached_property
    def _stamps(self) -> np.ndarray:
        """Instant of each row [ns], from 1970 or another zero; of a row without time: anything."""
        return np.nan_to_num(np.round(self._seconds * NANOSECONDS)).astype(np.int64) + self._zero

    @cached_property
    def _zero(self) -> int:
        """Instant of the first row [ns]: apart, since nanoseconds since 1970 have more digits than a double."""
        offset = round((self.declared.time_offset or 0.0) * NANOSECONDS)
        return offset if self.declared.time is None else offset + self._times[0]

    @cached_property
    def _seconds(self) -> np.ndarray:
        """Seconds from the first row with a time on, NaN where there is none."""
        uniform = np.arange(len(self.table.frame)) / (self.declared.rate or 1.0)
        if self.declared.time is None:
            return uniform
        seconds = self._times[1]
        if self.declared.rate is not None:
            self._check_rate(seconds, uniform)
            return uniform
        return seconds

    def _check_rate(self, seconds: np.ndarray, uniform: np.ndarray) -> None:
        """Refuse a rate that coarse times contradict: samples are missing, or the rate is another."""
        known = seconds[np.isfinite(seconds)]
        off = known - uniform[np.isfinite(seconds)]
        if np.ptp(off) > 1.01 * _resolution(known) + 1e-9:
            mean = (len(off) - 1) / np.ptp(known)
            raise RunError(
                f"times in {self.path.name} depart by {np.ptp(off):.3g} s from {self.declared.rate:g} Hz: correct rate "
                f"(the times tell some {mean:.6g} Hz), or the table, which may lack samples"
            )

    @cached_property
    def _times(self) -> tuple[int, np.ndarray]:
        """Instant of the first row [ns], and seconds of each since then."""
        import pandas as pd

        name, cells = self.path.name, self.table.frame[self.table.places["time"][0]]
        if isinstance(cells.dtype, np.dtype) and cells.dtype.kind in "iuf":
            unit = self._time_unit()
        elif (values := pd.to_numeric(cells, errors="coerce")).isna().all():
            cells, unit = _dates(cells, name, self.table.layout.first), "ns"
        else:
            self.table.numbers("time")  # it says which cell is no number
            cells, unit = values, self._time_unit()
        known = cells[cells.notna()]
        if not len(known):
            raise RunError(f"no times in column {quoted(str(self.declared.time))} of {name}: write rate instead")
        factor, start = scale(unit, "s"), known.iloc[0]
        if (float(known.max()) - min(float(known.min()), 0.0)) * factor > LATEST:
            last = float(known.iloc[-1]) * factor
            raise RunError(f"time in {name} reaches {last:.3g} s: correct columns.time_unit")
        nanoseconds = round(factor * NANOSECONDS)
        exact = nanoseconds >= 1 and isinstance(start, (int, np.integer))
        first = int(start) * nanoseconds if exact else round(float(start) * factor * NANOSECONDS)
        return first, np.asarray((cells - start) * factor, float)

    def _time_unit(self) -> str:
        declared, stated = self.declared.time_unit, self.unit("time")
        if declared is None and stated is None:
            raise ExperimentError('columns.time_unit belongs to a time column: add it, such as time_unit = "s"')
        if declared and stated and abs(scale(declared, "s") / scale(stated, "s") - 1) > 1e-9:
            raise ExperimentError(
                f"{self.path.name} states times in {stated}, columns.time_unit says {declared}: correct the map"
            )
        return declared or str(stated)


def rate_of_coarse(t: np.ndarray) -> float | None:
    """Return the sample rate [Hz] that repeated, coarse times tell: the roundest within their resolution.

    Args:
        t: times that do not decrease [s], (n,).
    """
    if len(t) < 10 or not t[-1] > t[0]:
        return None
    tick, count = _resolution(t), len(t) - 1
    low, high = count / (t[-1] - t[0] + tick), count / max(t[-1] - t[0] - tick, tick)
    for digits in range(1, 7):
        rate = float(f"{count / (t[-1] - t[0]):.{digits - 1}e}")
        if low <= rate <= high:
            return rate
    return None


def _resolution(t: np.ndarray) -> float:
    """Resolution of times of which some repeat: their usual step, which no gap changes."""
    steps = np.diff(t)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def _dates(cells: "pd.Series", name: str, first: int) -> "pd.Series":
    """Nanoseconds since 1970 of dates or times of day as text; those without a zone count as universal time."""
    import pandas as pd
    from pandas.tseries.api import guess_datetime_format

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
