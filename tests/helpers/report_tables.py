"""An experiment file of T1 in ten seconds, and a complete table ``[report]`` for it."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
T1 = (ROOT / "uq" / "examples" / "t1-10s.toml").read_text("utf-8")
FULL = """
[report]
title = "Inertia tensor of a drone"
number = "2026-0173"
location = "on the customer's premises"
method = "five T1 runs"
deviations = "none"
received = 2026-03-02
performed = [2026-03-04, 2026-03-05]
issued = 2026-03-09
traceability = "to the SI through the certificates below"
coverage_factor = 2
laboratory = { name = "Test hall", address = "1 Street" }
customer = { name = "A customer" }
item = { description = "drone", serial_number = "17", condition = "new" }
conditions = { temperature = "(21.3 ± 0.5) °C" }
approved_by = { name = "A. Person", function = "head" }

[[report.instrument]]
name = "load_cell"
serial_number = "LC-1"
certificate = "K 17"
calibrated = 2025-04-01
due = 2026-04-01

[report.conformity]
specification = "drawing 4"
rule = "guarded"
limits = { I11 = ["300 g*m^2", "0.4 kg*m^2"] }
"""
