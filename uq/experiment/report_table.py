"""The table ``[report]``: what a certificate says beside the figures (ISO/IEC 17025:2017, 7.8.2 and 7.8.4).

docs/how-to/certificate.md explains the keys. Nothing is required; what is missing is printed as "not stated".
Accreditation is never claimed.
"""

from collections.abc import Iterator, Mapping, Sequence
from datetime import date, datetime
from typing import Annotated, Any

import msgspec

from rig.exceptions import quoted
from rig.toml_tables import TomlTable, WrongKeyError, read_value, written
from uq.experiment.conformity import Conformity
from uq.files.mistakes import ExperimentError
from uq.files.schema import declared_table


def _day(_: str, raw: Any) -> date:
    """A day, written as TOML's date or as its string."""
    if isinstance(raw, datetime):
        return raw.date()
    try:
        return raw if isinstance(raw, date) else date.fromisoformat(raw if isinstance(raw, str) else "")
    except ValueError:
        raise ValueError(f"is {quoted(raw)}: write a date, such as 2026-03-31") from None


def _days(path: str, raw: Any) -> tuple[date, ...]:
    """A day, or the first and the last."""
    days = read_value(path, raw if isinstance(raw, list) else [raw], tuple[Day, ...])
    if len(days) > 2 or list(days) != sorted(days):
        raise ValueError(f"is {quoted(raw)}: write a date, or the first and the last")
    return days


DAY = {"type": "string", "format": "date"}
Day = Annotated[date, written(_day, DAY)]


class Texts(TomlTable, frozen=True, kw_only=True):
    """A table with texts, all of which may be missing."""

    @property
    def texts(self) -> dict[str, str]:
        """The texts that say something, by their keys."""
        values = {key: value for key, value in self.to_dict().items() if isinstance(value, str)}
        return {key: text.strip() for key, text in values.items() if text.strip()}


class Party(Texts, frozen=True, kw_only=True):
    """The laboratory that measures, or its customer."""

    name: str | None = None
    address: str | None = None
    contact: str | None = None


class Item(Texts, frozen=True, kw_only=True):
    """The item that is measured."""

    description: str | None = None
    identification: str | None = None
    manufacturer: str | None = None
    model: str | None = None
    serial_number: str | None = None
    condition: str | None = None


class Person(Texts, frozen=True, kw_only=True):
    """A person who approves the report."""

    name: str | None = None
    function: str | None = None


class InstrumentTable(Texts, frozen=True, kw_only=True):
    """``[[report.instrument]]``: an instrument and its calibration."""

    name: str | None = None
    manufacturer: str | None = None
    model: str | None = None
    serial_number: str | None = None
    certificate: str | None = None
    """Number of the certificate of calibration."""
    calibrated_by: str | None = None
    note: str | None = None
    calibrated: Day | None = None
    """Day of the instrument's calibration."""
    due: Day | None = None
    """Day by which the instrument is to be calibrated again."""


INSTRUMENT = ("name", "manufacturer", "model", "serial_number", "certificate", "calibrated_by", "note")


class ReportTable(Texts, frozen=True, kw_only=True):
    """``[report]``: particulars of a certificate beside the figures."""

    title: str | None = None
    number: str | None = None
    """Number of the report."""
    location: str | None = None
    """Place where the work was done."""
    method: str | None = None
    deviations: str | None = None
    """Deviations from the method."""
    sampling: str | None = None
    customer_data: str | None = None
    """Data that the customer provided."""
    external: str | None = None
    """Results that external providers gave."""
    adjustment: str | None = None
    """Adjustment or repair of the item, with the results before it."""
    traceability: str | None = None
    reproduction: str | None = None
    """Terms on which the report may be copied."""
    remarks: str | None = None
    laboratory: Party = Party()
    customer: Party = Party()
    item: Item = Item()
    received: Day | None = None
    """Day on which the item was received."""
    performed: Annotated[tuple[date, ...], written(_days, {"anyOf": [DAY, {"type": "array", "items": DAY}]})] = ()
    """Day of the work, or its first and last."""
    issued: Day | None = None
    """Day on which the report was issued."""
    conditions: Mapping[str, str] = {}
    """Environmental conditions, each by its name."""
    instrument: tuple[InstrumentTable, ...] = ()
    coverage_factor: Annotated[float, msgspec.Meta(ge=1, le=10)] | None = None
    """Coverage factor of expanded uncertainties; ``coverage_probability`` may be stated instead."""
    coverage_probability: Annotated[float, msgspec.Meta(ge=0.5, le=0.9999)] | None = None
    """Coverage probability of expanded uncertainties; ``coverage_factor`` may be stated instead."""
    approved_by: Person | tuple[Person, ...] = ()
    """Person, or several persons, who approve the report."""
    conformity: Conformity | None = None
    """A statement of conformity."""

    def __post_init__(self) -> None:
        """Refuse both factor and probability."""
        if self.coverage_factor is not None and self.coverage_probability is not None:
            raise WrongKeyError("", "has both coverage_factor and coverage_probability: write one, the other follows")


class Instrument(InstrumentTable, frozen=True, kw_only=True):
    """An instrument and its calibration, by the table or by a recording."""

    recorded: bool = False
    """Whether the recording itself names the instrument."""

    @property
    def label(self) -> str:
        """Name of the instrument in texts."""
        texts = (self.texts.get(key) for key in ("name", "model", "serial_number"))
        return next((text for text in texts if text), "instrument")

    def is_same(self, other: "Instrument") -> bool:
        """Whether two descriptions are of one instrument: by serial number, or by name."""
        pairs = [(self.texts.get(key), other.texts.get(key)) for key in ("serial_number", "name")]
        return any(mine is not None and mine == theirs for mine, theirs in pairs)


class Report(ReportTable, frozen=True, kw_only=True):
    """Particulars of a certificate beside the figures: those of the table, and the recordings' where it states none."""

    instruments: tuple[Instrument, ...] = ()
    performed_recorded: bool = False
    """Whether the days of the work come from the recordings."""

    @property
    def coverage(self) -> dict[str, float | None]:
        """Coverage factor or probability of expanded uncertainties; None: it follows from the other, or is usual."""
        return {"factor": self.coverage_factor, "probability": self.coverage_probability}

    @property
    def approvers(self) -> tuple[Mapping[str, str], ...]:
        """Name and function of each who approves."""
        people = self.approved_by if isinstance(self.approved_by, tuple) else (self.approved_by,)
        return tuple(person.texts for person in people)


def parse_report(content: Mapping[str, Any]) -> Report:
    """Return what the table ``[report]`` says.

    Raises:
        ExperimentError: an unknown key, a value of the wrong kind, or a claim of accreditation.
    """
    refuse_claims(content)
    table = declared_table("report", content, ReportTable)
    conditions = {key: text.strip() for key, text in table.conditions.items() if text.strip()}
    instruments = tuple(Instrument(**msgspec.structs.asdict(entry)) for entry in table.instrument)
    return Report(**table.to_dict() | {"conditions": conditions}, instruments=instruments)


def refuse_claims(content: object) -> None:
    """Refuse a table ``[report]`` that claims accreditation.

    Raises:
        ExperimentError: a key, or the title, speaks of it.
    """
    for path in _claims("report", content):
        raise ExperimentError(f"{path} would claim accreditation, which a page made by a program cannot: remove it")


def read(provenance: Mapping[str, Any]) -> Report:
    """Return the report that a result carries, with what its recordings say where the table is silent."""
    report = parse_report(provenance.get("report", {}))
    inputs = provenance.get("inputs", ())
    days = recorded_days(inputs)
    stated, unmatched = [], recorded_instruments(inputs)
    for instrument in report.instruments:
        same = [other for other in unmatched if instrument.is_same(other)]
        stated.append(msgspec.structs.replace(instrument, **{**(same[0].texts if same else {}), **instrument.texts}))
        unmatched = [other for other in unmatched if other not in same]
    performed = report.performed or tuple(dict.fromkeys([*days[:1], *days[-1:]]))
    recorded = bool(days) and not report.performed
    return msgspec.structs.replace(
        report, performed=performed, performed_recorded=recorded, instruments=(*stated, *unmatched)
    )


def recorded_days(inputs: Sequence[Mapping[str, Any]]) -> list[date]:
    """Return the days on which runs were recorded, as the recordings say."""
    return sorted({date.fromisoformat(entry["date"]) for entry in inputs if "date" in entry})


def recorded_instruments(inputs: Sequence[Mapping[str, Any]]) -> list[Instrument]:
    """Return the instruments that recordings name, each once."""
    texts = [
        {key: stated[key] for key in INSTRUMENT if key in stated}
        for entry in inputs
        for stated in entry.get("instruments", ())
    ]
    return [Instrument(**stated, recorded=True) for k, stated in enumerate(texts) if stated not in texts[:k]]


def cautions(table: Mapping[str, Any], inputs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return where a report's dates and serial numbers contradict each other or the recordings, a line each.

    Args:
        table: the table ``[report]``.
        inputs: what a result records of its runs.
    """
    report = parse_report(table)
    return [*_of_dates(report, recorded_days(inputs)), *_of_serial_numbers(report, recorded_instruments(inputs))]


def _of_serial_numbers(report: Report, recorded: list[Instrument]) -> Iterator[str]:
    for instrument in report.instruments:
        for other in recorded:
            numbers = [entry.texts.get("serial_number") for entry in (instrument, other)]
            if instrument.is_same(other) and all(numbers) and numbers[0] != numbers[1]:
                yield f"{instrument.label} has serial number {numbers[0]} in [report] and {numbers[1]} in a recording"


def _of_dates(report: Report, measured: Sequence[date]) -> list[str]:
    warnings, days, performed = [], sorted({*report.performed, *measured}), report.performed
    if outside := [day for day in measured if performed and not performed[0] <= day <= performed[-1]]:
        warnings.append(f"a run was recorded on {outside[0]}, outside report.performed")
    if days and report.received and report.received > days[0]:
        warnings.append(f"the item was received on {report.received}, after the measurement of {days[0]}")
    if days and report.issued and report.issued < days[-1]:
        warnings.append(f"the report was issued on {report.issued}, before the measurement of {days[-1]}")
    return warnings + [text for instrument in report.instruments for text in _of_calibration(instrument, days)]


def _of_calibration(instrument: Instrument, days: list[date]) -> Iterator[str]:
    name, calibrated, due = instrument.label, instrument.calibrated, instrument.due
    if due and days and due < days[-1]:
        yield f"calibration of {name} was due on {due}, before the measurement of {days[-1]}"
    if due and not days:
        yield f"calibration of {name} is due on {due}, and no date of the measurement is known to compare with"
    if calibrated and days and calibrated > days[0]:
        yield f"{name} was calibrated on {calibrated}, after the measurement of {days[0]}"
    if calibrated and due and due < calibrated:
        yield f"calibration of {name} is due on {due}, before it was calibrated on {calibrated}"


def _claims(where: str, content: object) -> Iterator[str]:
    """Paths of the keys, and of the title, that speak of accreditation."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            path = f"{where}.{key}" if where else str(key)
            if "accredit" in str(key).lower() or (key == "title" and "accredit" in str(value).lower()):
                yield path
            yield from _claims(path, value)
    elif isinstance(content, list):
        for k, item in enumerate(content):
            yield from _claims(f"{where}[{k}]", item)
