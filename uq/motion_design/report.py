"""The skeleton of both design reports: verdicts above the tables, files, result.json, the section of a page."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from identify.motion.limit_peaks import Peak
from identify.reporting import Result, Section
from identify.rigid_body.inertia import COMPONENTS
from identify.rounding import fixed
from identify.text_tables import Table
from uq.report.input_tables import source_tables


class MotionReport(Result):
    """The report of a designed motion; a subclass states its verdicts, findings, tables and figures."""

    heading: ClassVar[str]
    method: ClassVar[str]
    """Paragraph on what was computed."""
    goal: str
    contents: Mapping[str, bytes]
    """Contents of the files by name."""
    provenance: Mapping[str, Any]
    name: str = "design"

    def verdicts(self) -> list[str]:
        """Return what the design says in words, the most important first."""
        raise NotImplementedError

    def findings(self) -> list[str]:
        """Return what a reader must not miss."""
        raise NotImplementedError

    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""
        raise NotImplementedError

    def assumptions(self) -> Sequence[str]:
        """Return what the prediction assumes."""
        raise NotImplementedError

    def remarks(self) -> list[str]:
        """Return what only the page says beside the findings."""
        return []

    def details(self) -> list[Table]:
        """Return the tables that follow the figures."""
        return []

    def title(self) -> str:
        """Return the verdicts, a line each."""
        return "\n".join(self.verdicts())

    def overview(self) -> list[Table]:
        """Return the tables without captions."""
        return [replace(table, caption="") for table in self.tables()]

    def notes(self) -> list[str]:
        """Return the findings, a line each."""
        return [f"attention: {text}" for text in self.findings()]

    def files(self) -> dict[str, bytes]:
        """Return the files' bytes by name."""
        return dict(self.contents)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m² where no unit is named."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "goal": self.goal,
            **self.content(),
            "files": list(self.contents),
            "warnings": self.findings(),
            "provenance": dict(self.provenance),
        }

    def section(self) -> Section:
        """Return its part of a report."""
        verdict, *others = self.verdicts()
        return Section(
            title=self.heading, computed=[*others, self.method], findings=[*self.findings(), *self.remarks()],
            tables=self.tables(), drawings=self.drawings(), details=[*self.details(), *source_tables(self.provenance)],
            assumptions=self.assumptions(), provenance=self.provenance, verdict=verdict,
        )  # fmt: skip


def peak_cells(peak: Peak, where: str) -> list[str]:
    """Return a row of a table of limits: which limit is used where, when [s], and how much of it [%]."""
    return [peak.quantity.replace("_", " "), where, fixed(peak.t, 3), fixed(100 * peak.share, 1)]


def by_component(values: np.ndarray) -> dict[str, float]:
    """Return the tensor's values by component."""
    return dict(zip(COMPONENTS, values.tolist(), strict=True))
