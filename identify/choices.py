"""Choices of a caller of ``identify``."""

from typing import Literal

OffsetChoice = Literal["estimate", "still", "none"]
"""Treatment of the load cell's constant offsets: estimated with the tensor, taken from still segments, or none."""

CgMotion = Literal["still"]
"""Declared motion of the centre of gravity: ``still`` where the motion keeps it at rest."""
