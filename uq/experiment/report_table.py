"""The table ``[report]``: what a certificate says beside the figures (ISO/IEC 17025:2017, 7.8.2 and 7.8.4).

docs/certificate.md explains the keys. Nothing is required; what is missing is printed as "not stated". Accreditation is
never claimed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from typing import Any

from uq.experiment.conformity import Conformity, parse_conformity
from uq.files.document import ExperimentError, Table, day

PARTY = ("name", "address", "contact")
ITEM = ("description", "identification", "manufacturer", "model", "serial_number", "condition")
INSTRUMENT = ("name", "manufacturer", "model", "serial_number", "certificate", "calibrated_by", "note")
TEXTS = (
    "title", "number", "location", "method", "deviations", "sampling", "customer_data", "external", "adjustment",
    "traceability", "reproduction", "remarks",
)  # fmt: skip


@dataclass(frozen=True)
class Instrument:
    """An instrument and its calibration; None: not stated."""

    texts: Mapping[str, str]
    """By the names of ``INSTRUMENT``."""
    calibrated: date | None = None
    due: date | None = None
    recorded: bool = False
    """Whether it is the recording that names it."""

    @property
    def name(self) -> str:
        """What to call it."""
        known = (self.texts.get(key) for key in ("name", "model", "serial_number"))
        return next((text for text in known if text), "instrument")

    def is_same(self, other: "Instrument") -> bool:
        """Whether two descriptions are of one instrument: by serial number, or by name."""
        pairs = [(self.texts.get(key), other.texts.get(key)) for key in ("serial_number", "name")]
        return any(one is not None and one == two for one, two in pairs)


@dataclass(frozen=True)
class Report:
    """What a certificate says beside the figures. Missing texts are not in the mappings; missing dates are None."""

    texts: Mapping[str, str] = field(default_factory=dict)
    """By the names of ``TEXTS``."""
    laboratory: Mapping[str, str] = field(default_factory=dict)
    """By the names of ``PARTY``."""
    customer: Mapping[str, str] = field(default_factory=dict)
    item: Mapping[str, str] = field(default_factory=dict)
    """By the names of ``ITEM``."""
    received: date | None = None
    performed: tuple[date, ...] = ()
    """First and last day of the work, or the only one."""
    performed_recorded: bool = False
    """Whether it is the recordings that tell these days."""
    issued: date | None = None
    conditions: Mapping[str, str] = field(default_factory=dict)
    """Environmental conditions, each by its name."""
    instruments: tuple[Instrument, ...] = ()
    coverage_factor: float | None = None
    coverage_probability: float | None = None
    approved_by: tuple[Mapping[str, str], ...] = ()
    """Name and function of each."""
    conformity: Conformity | None = None


def parse_report(table: Table) -> Report:
    """Return the table ``[report]``.

    Raises:
        ExperimentError: an unknown key, a value of the wrong kind, or a claim of accreditation.
    """
    for path in _claims(table.where, table.content):
        raise ExperimentError(f"{path} would claim accreditation, which a page made by a program cannot: remove it")
    report = Report(
        texts=_texts(table, TEXTS),
        laboratory=table.table("laboratory", lambda part: _texts(part, PARTY, last=True), {}),
        customer=table.table("customer", lambda part: _texts(part, PARTY, last=True), {}),
        item=table.table("item", lambda part: _texts(part, ITEM, last=True), {}),
        received=table.date("received", None),
        performed=_days(table, "performed"),
        issued=table.date("issued", None),
        conditions=_free(table, "conditions"),
        instruments=table.tables("instrument", _instrument),
        coverage_factor=_number(table, "coverage_factor", 1.0, 10.0),
        coverage_probability=_number(table, "coverage_probability", 0.5, 0.9999),
        approved_by=_people(table),
        conformity=table.table("conformity", parse_conformity) if "conformity" in table.content else None,
    )
    table.finish()
    if report.coverage_factor is not None and report.coverage_probability is not None:
        raise ExperimentError(
            f"{table.where} has both coverage_factor and coverage_probability: write one, the other follows"
        )
    return report


def read(provenance: Mapping[str, Any]) -> Report:
    """Return the report that a result carries, with what its recordings say where the table is silent."""
    report = parse_report(Table("report", provenance.get("report", {})))
    inputs = provenance.get("inputs", ())
    days = recorded_days(inputs)
    stated, left = [], _recorded_instruments(inputs)
    for one in report.instruments:
        same = [other for other in left if one.is_same(other)]
        stated.append(replace(one, texts={**(same[0].texts if same else {}), **one.texts}))
        left = [other for other in left if other not in same]
    performed = report.performed or ((days[0], days[-1]) if len(days) > 1 else tuple(days))
    told = bool(days) and not report.performed
    return replace(report, performed=performed, performed_recorded=told, instruments=(*stated, *left))


def recorded_days(inputs: Sequence[Mapping[str, Any]]) -> list[date]:
    """Return the days on which runs were recorded, as the recordings say."""
    return sorted({date.fromisoformat(entry["date"]) for entry in inputs if "date" in entry})


def _recorded_instruments(inputs: Sequence[Mapping[str, Any]]) -> list[Instrument]:
    """The instruments that recordings name, each once."""
    texts = [
        {key: one[key] for key in INSTRUMENT if key in one} for entry in inputs for one in entry.get("instruments", ())
    ]
    return [Instrument(one, recorded=True) for k, one in enumerate(texts) if one not in texts[:k]]


def cautions(table: Mapping[str, Any], inputs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return where a report's dates and serial numbers contradict each other or the recordings, a line each.

    Args:
        table: the table ``[report]``.
        inputs: what a result records of its runs.
    """
    report = parse_report(Table("report", table))
    return [*_of_dates(report, recorded_days(inputs)), *_of_serial_numbers(report, _recorded_instruments(inputs))]


def _of_serial_numbers(report: Report, recorded: list[Instrument]) -> Iterator[str]:
    for one in report.instruments:
        for other in recorded:
            numbers = [each.texts.get("serial_number") for each in (one, other)]
            if one.is_same(other) and all(numbers) and numbers[0] != numbers[1]:
                yield f"{one.name} has serial number {numbers[0]} in [report] and {numbers[1]} in a recording"


def _of_dates(report: Report, measured: Sequence[date]) -> list[str]:
    found, days = [], sorted({*report.performed, *measured})
    if report.performed and measured and not _within(measured, report.performed):
        found.append(f"a run was recorded on {_outside(measured, report.performed)}, outside report.performed")
    if days and report.received and report.received > days[0]:
        found.append(f"the item was received on {report.received}, after the measurement of {days[0]}")
    if days and report.issued and report.issued < days[-1]:
        found.append(f"the report was issued on {report.issued}, before the measurement of {days[-1]}")
    return found + [text for one in report.instruments for text in _of_calibration(one, days)]


def _of_calibration(one: Instrument, days: list[date]) -> Iterator[str]:
    if one.due and days and one.due < days[-1]:
        yield f"calibration of {one.name} was due on {one.due}, before the measurement of {days[-1]}"
    if one.due and not days:
        yield f"calibration of {one.name} is due on {one.due}, and no date of the measurement is known to compare with"
    if one.calibrated and days and one.calibrated > days[0]:
        yield f"{one.name} was calibrated on {one.calibrated}, after the measurement of {days[0]}"
    if one.calibrated and one.due and one.due < one.calibrated:
        yield f"calibration of {one.name} is due on {one.due}, before it was calibrated on {one.calibrated}"


def _within(days: Sequence[date], period: Sequence[date]) -> bool:
    return min(period) <= min(days) and max(days) <= max(period)


def _outside(days: Sequence[date], period: Sequence[date]) -> date:
    return next(one for one in days if not min(period) <= one <= max(period))


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


def _texts(table: Table, keys: tuple[str, ...], *, last: bool = False) -> dict[str, str]:
    """The texts among these keys that say something."""
    found = {key: table.typed(key, str, None) for key in keys}
    if last:
        table.finish()
    return {key: text.strip() for key, text in found.items() if text and text.strip()}


def _free(table: Table, key: str) -> dict[str, str]:
    """A table of texts by names of the user's."""
    content = table.mapping(key)
    return _texts(Table(table.path(key), content), tuple(content))


def _instrument(table: Table) -> Instrument:
    texts = _texts(table, INSTRUMENT)
    instrument = Instrument(texts, table.date("calibrated", None), table.date("due", None))
    table.finish()
    return instrument


def _people(table: Table) -> tuple[Mapping[str, str], ...]:
    """Who approves: one or several."""
    raw = table.raw("approved_by", [])
    people = raw if isinstance(raw, list) else [raw]
    where = table.path("approved_by")
    return tuple(_texts(Table(where, one), ("name", "function"), last=True) for one in people)


def _days(table: Table, key: str) -> tuple[date, ...]:
    """A day, or the first and the last."""
    raw = table.raw(key, [])
    days = tuple(day(table.path(key), one) for one in (raw if isinstance(raw, list) else [raw]))
    if len(days) > 2 or list(days) != sorted(days):
        raise ExperimentError(f"{table.path(key)} is {raw!r}: write a date, or the first and the last")
    return days


def _number(table: Table, key: str, low: float, high: float) -> float | None:
    value = table.numbers(key, (), None)
    if value is not None and not low <= value <= high:
        raise ExperimentError(f"{table.path(key)} is {table.content[key]!r}: write a number from {low:g} to {high:g}")
    return None if value is None else float(value)
