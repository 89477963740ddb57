"""Files and result.json of a designed motion's report, for a platform and for an arm."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from identify.display.reporting import Result
from uq.files.output_folder import HasFiles


class MotionReport(HasFiles, Result, ABC):
    """The report of a designed motion; a subclass states its warnings and its numbers."""

    goal: str
    provenance: Mapping[str, Any]
    name: str = "design"

    @property
    @abstractmethod
    def warnings(self) -> list[str]:
        """Warnings that a reader must not miss."""

    @abstractmethod
    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m² where no unit is named."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "goal": self.goal,
            **self.content(),
            "files": list(self.contents),
            "warnings": self.warnings,
            "provenance": dict(self.provenance),
        }
