"""Contradictions between runs and what is declared of them, as results list them: causes, declared quantities."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from identify.display.rounding import rounded, with_uncertainty

CONTRADICTED = 5.0
"""Standard uncertainties of what was declared beyond which the runs contradict it.

Chance: 6e-7 of a normal distribution.
"""


class Declaration(NamedTuple):
    """A declared quantity that the runs place far from what was declared of it. SI units."""

    quantity: str
    """Name of the unknown, of :data:`identify.estimation.joint.joint_model.SIZES`."""
    words: str
    axis: int | None
    """Axis of a vector, 1 to 3; None: it is none."""
    value: float
    """Value that the runs give it, with what was declared as the prior."""
    declared: float
    standard_uncertainty: float
    """Standard uncertainty of what was declared; a typical one where ``exact``."""
    exact: bool
    """Whether it was declared without a standard uncertainty."""
    scale: float
    """Number of the unit of the text in one of SI."""
    unit: str
    advice: str

    @property
    def distance(self) -> float:
        """Distance of the value from what was declared, in standard uncertainties of that."""
        return abs(self.value - self.declared) / self.standard_uncertainty

    @property
    def contradicted(self) -> bool:
        """Whether the runs contradict what was declared."""
        return self.distance > CONTRADICTED

    @property
    def name(self) -> str:
        """The quantity in words, with its axis."""
        return self.words if self.axis is None else f"{self.words} on axis {self.axis}"

    @property
    def text(self) -> str:
        """Line on the departure and its cure."""
        value, declared, u = (self.scale * figure for figure in (self.value, self.declared, self.standard_uncertainty))
        return (
            f"the {self.name} comes to {rounded(value, u)} {self.unit}, {self.distance:.1f} standard uncertainties "
            f"from what was declared ({with_uncertainty(declared, u)}): {self.advice}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in SI."""
        kept = ("quantity", "axis", "value", "declared", "standard_uncertainty", "exact", "distance")
        return {name: getattr(self, name) for name in kept} | {"status": status(self.contradicted)}


def status(contradicted: object) -> Literal["contradicted", "not contradicted"]:
    """Return the word of result.json for something that the runs contradict, or do not."""
    return "contradicted" if contradicted else "not contradicted"


def contradiction(declarations: Sequence[Declaration]) -> str:
    """Return a clause that names what the runs contradict; '' where they contradict nothing."""
    names = [f"{record.name} ({record.distance:.1f} u off)" for record in declarations if record.contradicted]
    return f"the runs contradict what is declared of {', '.join(names)}" if names else ""


class ResidualCause(NamedTuple):
    """A cause that a run's residuals follow."""

    cause: str
    """Label of the likely cause, of :class:`identify.judge.findings.Finding`."""
    axis: str
    """Axis of the moment on which it shows most, b1, b2 or b3; of repeatability the component."""
    share: float
    """Part of the residuals' variance that it explains; of repeatability the scatter over the predicted one."""
    text: str
    """One line that says so."""
    run: str = ""
    """Name of the run."""
    changes: tuple[float, ...] = ()
    """Change that the cause would make in mass [kg], r_CG [m] and tensor [kg·m²]; () where that is not known."""
    note: bool = False
    """Whether the conventional bound holds as much at typical size already, which then is no warning."""
    docs: str = ""
    """Place in the documentation that says what it looks like, its cure, and how often it is named."""
