"""The front of a certificate: its particulars in words, and its number."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from identify.display.text_tables import Table
from uq.experiment.report_table import Instrument, Report

MISSING = "not stated"
FROM_RECORDING = "(from the recording)"
ONLY = "The results relate only to the item described above, as it was measured."
NO_CLAIM = "No accreditation is claimed."
REPRODUCTION = "This document shall not be reproduced except in full without approval of the issuing laboratory."
WHERE_RELEVANT = {
    "sampling": "Sampling",
    "adjustment": "Adjustment or repair",
    "external": "From external providers",
    "customer_data": "Provided by the customer",
    "remarks": "Remarks",
}
"""Items that are printed only when they are stated."""
INSTRUMENT_HEAD = ("instrument", "maker, model", "serial number", "certificate", "calibrated", "due")


@dataclass(frozen=True)
class Front:
    """Texts of a certificate beside its tables and figures."""

    number: str | None
    """Number of the certificate as stated; None: it is made of the result's content."""
    laboratory: Sequence[str]
    """Name, address and contact of the laboratory."""
    items: Sequence[tuple[str, Sequence[str]]]
    """Lines of the certificate below each heading."""
    instruments: Table
    """Instruments with their calibration."""
    statements: Sequence[str]
    approvals: Sequence[tuple[str, str]]
    """Name and function of each person who approves; empty: nobody is stated."""
    issued: str
    values: int
    """Number of the section's tables, the first, that stand with the signature on one page."""
    made_up: str
    """Nature of data that are no measurement: simulated or emulated; otherwise empty."""


def front(report: Report, provenance: Mapping[str, Any], values: int) -> Front:
    """Return the particulars in words; what is missing says so.

    Args:
        report: what ``[report]`` states.
        provenance: of the result.
        values: how many of the section's tables, the first, hold what is signed.
    """
    stated = report.texts
    made_up = {entry["made_up"] for entry in provenance.get("inputs", ()) if "made_up" in entry}
    return Front(
        number=stated.get("number"),
        laboratory=_party(report.laboratory.texts),
        items=[*_items(report), *((label, [stated[key]]) for key, label in WHERE_RELEVANT.items() if key in stated)],
        instruments=_instruments(report.instruments),
        statements=[
            ONLY,
            f"Reproduction: {stated['reproduction'].rstrip('.')}." if "reproduction" in stated else REPRODUCTION,
            NO_CLAIM,
        ],
        approvals=[(person.get("name", MISSING), person.get("function", "")) for person in report.approvers],
        issued=str(report.issued or MISSING),
        values=values,
        made_up=" and ".join(sorted(made_up)),
    )


def not_stated(front: Front) -> list[str]:
    """Return the items that ISO/IEC 17025:2017, 7.8.2, asks for and nobody states, by name."""
    items = [("Laboratory", front.laboratory), *front.items]
    missing = [name.lower() for name, lines in items if MISSING in lines]
    missing += ["instruments"] * (front.instruments.rows[0][0] == MISSING)
    return missing + ["approval"] * (not front.approvals)


def _items(report: Report) -> Iterator[tuple[str, list[str]]]:
    stated = report.texts
    yield "Customer", _party(report.customer.texts)
    yield "Item", _item(report.item.texts)
    yield "Condition of the item", [report.item.texts.get("condition", MISSING)]
    yield "Item received", [str(report.received or MISSING)]
    yield "Measured", [_performed(report)]
    yield "Issued", [str(report.issued or MISSING)]
    yield "Location of the work", [stated.get("location", MISSING)]
    yield "Method", [stated.get("method", MISSING)]
    yield "Deviations from the method", [stated.get("deviations", MISSING)]
    yield "Conditions", [f"{name.replace('_', ' ')}: {text}" for name, text in report.conditions.items()] or [MISSING]
    yield "Traceability", [stated.get("traceability", MISSING)]


def _party(party: Mapping[str, str]) -> list[str]:
    return [party[key] for key in ("name", "address", "contact") if key in party] or [MISSING]


def _item(item: Mapping[str, str]) -> list[str]:
    make = ", ".join(item[key] for key in ("manufacturer", "model") if key in item)
    serial = f"serial number {item['serial_number']}" if "serial_number" in item else ""
    lines = [item.get("description", ""), make, serial, item.get("identification", "")]
    return [line for line in lines if line] or [MISSING]


def _performed(report: Report) -> str:
    days = " to ".join(map(str, report.performed)) or MISSING
    return f"{days} {FROM_RECORDING}" if report.performed and report.performed_recorded else days


def _instruments(instruments: Sequence[Instrument]) -> Table:
    rows = list(map(_instrument, instruments)) or [[MISSING, *[""] * 5]]
    return Table("Instruments and their calibration", list(INSTRUMENT_HEAD), rows, wrap=True)


def _instrument(instrument: Instrument) -> list[str]:
    texts = instrument.texts
    name, make, certificate = (
        ", ".join(texts[key] for key in keys if key in texts)
        for keys in (("name", "note"), ("manufacturer", "model"), ("certificate", "calibrated_by"))
    )
    label = name or instrument.label
    cells = [make, texts.get("serial_number"), certificate, instrument.calibrated, instrument.due]
    return [f"{label} {FROM_RECORDING}" if instrument.recorded else label, *(str(cell or MISSING) for cell in cells)]


def number_of(content: Mapping[str, Any]) -> str:
    """Return the number of a report that states none: twelve digits of the SHA-256 of its content but the time."""
    kept = dict(content)
    kept["provenance"] = {key: value for key, value in kept.get("provenance", {}).items() if key != "time"}
    digest = hashlib.sha256(json.dumps(kept, sort_keys=True, default=str).encode()).hexdigest().upper()
    return "-".join(digest[k : k + 4] for k in (0, 4, 8))
