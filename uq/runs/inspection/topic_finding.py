"""Findings of the judge beside those of the channels' health."""

from identify.judge.findings import Finding
from rig.inspection.channel_health import TopicFinding


def topic_finding(finding: Finding, *, imported: bool) -> TopicFinding:
    """Return a finding of the judge as one on a topic.

    Args:
        finding: on the topic.
        imported: whether the run was imported from a table, whose map then states units, signs and axes.
    """
    return TopicFinding(finding.label, finding.topic, finding.written(_map_keys() if imported else ()))


def _map_keys() -> tuple[str, ...]:
    from uq.runs.tables.table_map import MapConventions  # which is needed for imported runs alone

    return MapConventions.__struct_fields__
