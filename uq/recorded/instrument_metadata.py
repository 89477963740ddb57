"""Statements of a recording on its instruments and its day, for a report that has none of its own."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np

FACTS = ("model", "serial_number", "firmware")
EARLIEST = 946_684_800_000_000_000
"""Start of the year 2000 [ns]: before it, a stamp counts from the run's start and tells no day."""


def about(metadata: Mapping[str, Mapping[str, str]], log_time: np.ndarray) -> dict[str, Any]:
    """Return day, note, instruments and whether it is a simulation, as far as a recording tells.

    Args:
        metadata: the recording's metadata records; ``rig.run`` is read.
        log_time: arrival of its messages at the host [ns since 1970].

    Returns:
        Keys ``date`` (ISO, UTC), ``note``, ``instruments`` (a mapping of ``FACTS`` and ``name`` each), ``made_up``
        (``"simulated"`` or ``"emulated"``), ``imported`` (from a table); what is not known is not there.
    """
    record = metadata.get("rig.run", {})
    facts: dict[str, Any] = {"instruments": _instruments(record)}
    if len(log_time) and log_time[0] >= EARLIEST:
        facts["date"] = datetime.fromtimestamp(int(log_time[0]) // 10**9, UTC).date().isoformat()
    if record.get("note"):
        facts["note"] = record["note"]
    if "imported" in record:
        facts["imported"] = True
    if "simulated" in record:
        facts["made_up"] = "simulated"
    elif any(value.startswith("emulator:") for key, value in record.items() if key.endswith(".port")):
        facts["made_up"] = "emulated"
    return {key: value for key, value in facts.items() if value}


def _instruments(record: Mapping[str, str]) -> list[dict[str, str]]:
    """Each device that the recording names, with what is known of it."""
    names = [key.removesuffix(".model") for key in record if key.endswith(".model") and key.count(".") == 1]
    return [{"name": name} | {fact: text for fact in FACTS if (text := record.get(f"{name}.{fact}"))} for name in names]
