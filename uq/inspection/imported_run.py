"""Cures of findings on a run that was imported from a table: lines in the map of its columns."""

from dataclasses import replace

from rig.inspection.channel_health import TopicFinding

HERE, IN_MAP = "in [recording]", "in [recording] of the map, on top of what it says, and import the table again"


def cured_in_map(finding: TopicFinding) -> TopicFinding:
    """Return a finding with the cure of an imported run, which states its units and axes."""
    set_in_experiment = any(f"set {key} =" in finding.text for key in ("compensated", "zero", "accelerometer_delay"))
    return finding if set_in_experiment else replace(finding, text=finding.text.replace(HERE, IN_MAP))
