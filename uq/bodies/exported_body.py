"""The content of every export format: mass, centre of gravity, tensor, and the lines of its comments.

All formats take the tensor about the centre of gravity, with the tensor's own entries off the diagonal (no integral's
sign), in kg, m and kg·m² unless a format says otherwise; principal moments come with right-handed axes.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import permutations

import numpy as np

from identify.rigid_body.principal_axes import principal
from rig.exceptions import on_one_line

MILLIMETRE = 1e3
"""mm in a metre."""


@dataclass(frozen=True)
class ExportedBody:
    """A rigid body in the frame in which it is exported. SI units."""

    mass: float
    """Mass of the body [kg]."""
    r_cg: np.ndarray
    """Centre of gravity from the frame's origin [m]."""
    inertia: np.ndarray
    """Packed tensor about the centre of gravity [kg·m²]."""
    notes: tuple[str, ...] = ()
    """Lines for a comment: uncertainty, provenance, warnings; plain ASCII."""
    content: dict = field(default_factory=dict)
    """Additional content of the JSON format: covariance and provenance."""
    name: str = "body"

    def __post_init__(self) -> None:
        """Write out control characters, which would end a comment or be none of XML's."""
        object.__setattr__(self, "notes", tuple(map(on_one_line, self.notes)))
        object.__setattr__(self, "name", on_one_line(self.name))

    @property
    def named(self) -> dict[str, float]:
        """The tensor's entries by the names that most formats give them: ixx, ixy, ixz, iyy, iyz, izz."""
        return dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), map(float, self.inertia), strict=True))

    def principal(self) -> tuple[np.ndarray, np.ndarray]:
        """Return principal moments [kg·m²] and the rotation from their axes' components to the frame's.

        Of the 24 right-handed choices of principal axes it is the one that turns least: no turn for a diagonal tensor.
        """
        moments, rows = principal(np.asarray(self.inertia))
        choices = [(order, _aligned(rows[list(order)])) for order in permutations(range(3))]
        order, axes = max(choices, key=lambda choice: np.trace(choice[1]))
        return moments[list(order)], axes.T


def _aligned(rows: np.ndarray) -> np.ndarray:
    """Axes with the signs that bring each nearest to its namesake.

    Of all orders the one with the largest trace is right-handed: a turn of at most 62.8° is among them, whose trace is
    1.9 or more, and no left-handed axes have one above 1.
    """
    return rows * np.where(np.diag(rows) < 0, -1.0, 1.0)[:, None]


def number(value: float) -> str:
    """Return the shortest text that reads back as the same double, never a minus before zero.

    An exponent has a point before it and a sign, or YAML 1.1 and some controllers would not take it for a number.
    """
    mantissa, mark, exponent = repr(float(value) + 0.0).partition("e")
    return f"{mantissa if '.' in mantissa else f'{mantissa}.0'}e{int(exponent):+d}" if mark else mantissa


def numbers(values: np.ndarray, between: str = " ") -> str:
    """Return several numbers in a row."""
    return between.join(map(number, np.ravel(values)))


def commented(body: ExportedBody, mark: str) -> list[str]:
    """Return the body's notes as comment lines."""
    return [f"{mark}{note}" for note in body.notes]


def xml_document(body: ExportedBody, lines: Sequence[str]) -> str:
    """Return an XML file of these lines, the body's notes in a comment before them."""
    notes = [f"     {re.sub('-(?=-|$)', '- ', note)}" for note in body.notes]
    comment = ["<!--", *notes, "-->"] if notes else []
    return "\n".join(['<?xml version="1.0"?>', *comment, *lines, ""])
