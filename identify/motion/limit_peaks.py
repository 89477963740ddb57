"""The largest use of each limit by a motion, and where it occurs."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float


class Peak(NamedTuple):
    """The largest use of a limit by a motion, and where it occurs."""

    quantity: str
    """Name of the limited quantity."""
    share: float
    """Used share of the limit; above 1 the limit is exceeded."""
    channel: int
    """Leg, joint, axis or pair of links, from 0."""
    where: str
    """Name of the leg, joint, axis or pair; empty where a quantity has one channel alone."""
    t: float
    """Instant of the largest use [s]."""

    def __str__(self) -> str:
        what = self.quantity.replace("_", " ") + (f" of {self.where}" if self.where else "")
        return f"{what} at {self.t:.3f} s: {100 * self.share:.1f} % of its limit"


def largest_uses(
    shares: Mapping[str, Float[Array, "n k"] | Float[np.ndarray, "n k"]],
    t: Float[Array, " n"] | Float[np.ndarray, " n"],
    where: Callable[[str, int], str],
) -> list[Peak]:
    """Return each limit's largest use, the largest first.

    Args:
        shares: used share of the limit by quantity, instants first, of either sign.
        t: instants [s].
        where: name of a quantity's channel.
    """
    listed = []
    for name, share in shares.items():
        values = np.abs(np.asarray(share))
        instant, channel = map(int, np.unravel_index(int(np.argmax(values)), values.shape))
        listed.append(Peak(name, float(values[instant, channel]), channel, where(name, channel), float(t[instant])))
    return sorted(listed, key=lambda peak: -peak.share)
