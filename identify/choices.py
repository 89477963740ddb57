"""What a caller of ``identify`` may choose between."""

from typing import Literal

OffsetChoice = Literal["estimate", "still", "none"]
"""Where constant offsets come from."""

CgMotion = Literal["still"]
"""How the centre of gravity moves, where that is declared."""
