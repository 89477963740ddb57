"""Delay and rotation between load cell and IMU as results: value, uncertainty, share of the prior in it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.display.rounding import significant, with_uncertainty
from identify.display.text_tables import enumerated
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, rotate
from identify.rigid_body.rotation import exponential

LARGEST_PRIOR_SHARE = 0.5
"""Share of the prior in a variance above which the motion does not determine the quantity."""

SIGNIFICANT = 3.0
"""Standard uncertainties from which a rotation is one."""


@dataclass(frozen=True)
class Aligned:
    """A delay [s], or a rotation vector [rad], of the IMU against the load cell, estimated with the tensor."""

    value: np.ndarray
    """The delay (1,), or the rotation vector (3,) of the rotation from the IMU's axes, as declared, to B."""
    covariance: np.ndarray
    """Covariance of ``value``, in the square of its unit."""
    interval95: np.ndarray
    """Coverage interval of 95 %, (1 or 3, 2)."""
    prior_share: np.ndarray
    """Share of the declared prior in each variance: 1 where the data add nothing."""

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each number of ``value``."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def estimated(self) -> bool:
        """Whether the quantity was estimated rather than taken as exact."""
        return bool((np.diag(self.covariance) > 0).any())

    def to_dict(self) -> dict[str, Any]:
        """Return its content in result.json: plain numbers for a delay, three for a rotation."""
        names = ("value", "standard_uncertainty", "interval95", "prior_share")
        arrays = {name: getattr(self, name) for name in names}
        scalar = len(self.value) == 1
        figures: dict[str, Any] = {name: (array[0] if scalar else array).tolist() for name, array in arrays.items()}
        return figures | {"estimated": self.estimated}


def alignment_warnings(delay: Aligned | None, rotation: Aligned | None) -> list[str]:
    """Return a warning for each quantity whose uncertainty is mostly the declared one; None: it is not asked for."""
    warnings = []
    if delay is not None and delay.estimated and delay.prior_share[0] > LARGEST_PRIOR_SHARE:
        warnings.append(
            f"the motion does not determine the delay: {100 * delay.prior_share[0]:.0f} % of its variance is the "
            "declared one; accelerate more, or declare it more closely"
        )
    if rotation is None or not rotation.estimated:
        return warnings
    axes = [axis for axis, share in zip("123", rotation.prior_share, strict=True) if share > LARGEST_PRIOR_SHARE]
    if axes:
        warnings.append(
            f"the motion does not determine the rotation between load cell and IMU about axis {enumerated(axes)}: the "
            "interval is what was declared; rotate about more axes, or declare it better"
        )
    return warnings


def turn_warnings(rotation: Aligned, inertia: np.ndarray, half_width: np.ndarray) -> list[str]:
    """Return a warning where a turn between IMU and load cell, taken as the IMU's, would matter were it the cell's.

    Args:
        rotation: as estimated.
        inertia: packed tensor [kg·m²].
        half_width: of its intervals [kg·m²].
    """
    if not rotation.estimated or not (np.abs(rotation.value) > SIGNIFICANT * rotation.standard_uncertainty).any():
        return []
    other = rotate(inertia, exponential(-rotation.value)) - inertia
    worst = int(np.argmax(np.abs(other) / np.maximum(half_width, 1e-300)))
    if abs(other[worst]) <= half_width[worst]:
        return []
    angles = listed(np.degrees(rotation.value), np.degrees(rotation.standard_uncertainty))
    by = significant(GRAM_METRE * other[worst], 2, signed=True)
    return [
        f"IMU and load cell are rotated relative to each other by ({angles})°: attributed to the IMU; if the load "
        f"cell is the rotated one, {COMPONENTS[worst]} changes by {by} g·m²: declare a misalignment of the wrench, or "
        "sigma_rotation if it is the IMU"
    ]


def listed(values: np.ndarray, errors: np.ndarray) -> str:
    """Return figures with their standard uncertainties, in the same unit, as text."""
    return ", ".join(map(with_uncertainty, values, errors))
