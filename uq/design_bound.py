"""What no motion of a platform can beat: a lower bound of the predicted uncertainty under its limits."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DesignBound:
    """Least average 3σ that the limits allow, and what the bound leaves out."""

    moments: float
    """Of the three moments [kg·m²]."""
    products: float
    """Of the three products [kg·m²]."""
    relaxes: tuple[str, ...]
    """What the bound does not ask of a motion."""
