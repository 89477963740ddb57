"""``[[calibration]]`` of a file of sources: when, with what and on which runs the rig was calibrated."""

from collections.abc import Mapping, Sequence
from datetime import date
from typing import Any

from rig.exceptions import RigError
from rig.toml_tables import Name, TomlTable
from uq.experiment.report_table import Day, Instrument, InstrumentTable, recorded_days, recorded_instruments


class CalibrationRunTable(TomlTable, frozen=True, kw_only=True):
    """``[[calibration.run]]``: a run of a known body."""

    file: str
    sha256: str = ""
    body: str = ""
    """Name of the known body."""


class CalibrationTable(TomlTable, frozen=True, kw_only=True):
    """``[[calibration]]``: a calibration of the rig by a known body, as `inertia calibrate` writes it."""

    group: Name
    """Group of the calibration's sources: results are corrected by their means."""
    made: Day | None = None
    """Day on which it was computed."""
    performed: Day | None = None
    """Day of the last run."""
    due: Day | None = None
    """Day by which the rig is to be calibrated again."""
    run: tuple[CalibrationRunTable, ...] = ()
    """Runs of the known bodies."""
    instrument: tuple[InstrumentTable, ...] = ()
    """Instruments that the recordings name."""
    warnings: tuple[str, ...] = ()
    """Warnings of the calibration, which every result that takes it repeats."""

    @property
    def title(self) -> str:
        """The calibration in a few words."""
        bodies = ", ".join(dict.fromkeys(run.body for run in self.run if run.body))
        day = self.performed or self.made
        return f"calibration{f' of {day}' if day else ''}{f' by {bodies}' if bodies else ''}"


def check_instruments(calibrations: Sequence[CalibrationTable], inputs: Sequence[Mapping[str, Any]]) -> None:
    """Refuse runs that were recorded with another instrument than the rig was calibrated with.

    Args:
        calibrations: that an experiment takes.
        inputs: what a result records of its runs.

    Raises:
        RigError: an instrument of the same name has another serial number.
    """
    for calibration in calibrations:
        for table in calibration.instrument:
            for recorded in recorded_instruments(inputs):
                then, now = (entry.texts.get("serial_number") for entry in (table, recorded))
                if table.texts.get("name") == recorded.texts.get("name") and then and now and then != now:
                    name = Instrument(**table.to_dict()).label
                    raise RigError(
                        f"the {calibration.title} was made with {name} of serial number {then}, a run was recorded "
                        f"with {now}: calibrate again, or take the calibration's file out of include"
                    )


def calibration_warnings(
    calibrations: Sequence[CalibrationTable], inputs: Sequence[Mapping[str, Any]], today: date
) -> list[str]:
    """Return what a result must say of the calibrations that it takes.

    Args:
        calibrations: that an experiment takes.
        inputs: what a result records of its runs.
        today: the day that counts where the runs tell none.
    """
    days, warnings = recorded_days(inputs) or [today], []
    for calibration in calibrations:
        if calibration.due is not None and days[-1] > calibration.due:
            warnings.append(
                f"the {calibration.title} was due on {calibration.due}, before the run of {days[-1]}: calibrate again"
            )
        warnings += [f"{calibration.title}: {text}" for text in calibration.warnings]
    return warnings
