"""A contradiction between a run and what is declared of it, as results list it."""

from typing import NamedTuple


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
    """Whether the second interval holds the cause already, which then is no warning."""
    docs: str = ""
    """Place in the documentation that says what it looks like, its cure, and how often it is named."""
