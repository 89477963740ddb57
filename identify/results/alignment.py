"""Delay and rotation between load cell and IMU as results: value, uncertainty, share of the prior in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

LARGEST_PRIOR_SHARE = 0.5
"""Share of the prior in a variance above which the motion does not determine the quantity."""


@dataclass(frozen=True)
class Aligned:
    """A delay [s], or a rotation vector [rad], of the IMU against the load cell, estimated with the tensor."""

    value: np.ndarray
    """The delay (1,), or the rotation vector (3,) of the rotation from the IMU's axes, as declared, to B."""
    covariance: np.ndarray
    """Of ``value``."""
    interval95: np.ndarray
    """Coverage interval of 95 %, (1 or 3, 2)."""
    prior_share: np.ndarray
    """How much of each variance comes from what was declared beforehand: 1 where the data add nothing."""

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each number of ``value``."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def estimated(self) -> bool:
        """Whether it was left free."""
        return bool((np.diag(self.covariance) > 0).any())

    def to_dict(self) -> dict[str, Any]:
        """Return its content in result.json: plain numbers for a delay, three for a rotation."""
        names = ("value", "standard_uncertainty", "interval95", "prior_share")
        arrays = {name: getattr(self, name) for name in names}
        scalar = len(self.value) == 1
        figures: dict[str, Any] = {name: (array[0] if scalar else array).tolist() for name, array in arrays.items()}
        return figures | {"estimated": self.estimated}


def alignment_warnings(delay: Aligned, rotation: Aligned) -> list[str]:
    """Return a warning for each quantity whose uncertainty is mostly the declared one."""
    warnings = []
    if delay.estimated and delay.prior_share[0] > LARGEST_PRIOR_SHARE:
        warnings.append(
            f"the motion does not tell the delay: {100 * delay.prior_share[0]:.0f} % of its variance is what was "
            "declared; accelerate more, or declare it better"
        )
    axes = [axis for axis, share in zip("123", rotation.prior_share, strict=True) if share > LARGEST_PRIOR_SHARE]
    if rotation.estimated and axes:
        warnings.append(
            f"the motion does not tell the rotation between load cell and IMU about axis {_and(axes)}: the interval is "
            "what was declared; rotate about more axes, or declare it better"
        )
    return warnings


def alignment_notes(delay: Aligned | None, rotation: Aligned | None) -> list[str]:
    """Return a line for each that was estimated."""
    notes = []
    if delay is not None and delay.estimated:
        notes.append(f"delay of the IMU: {_with_error(1e3 * delay.value, 1e3 * delay.standard_uncertainty)} ms")
    if rotation is not None and rotation.estimated:
        angles, errors = np.degrees(rotation.value), np.degrees(rotation.standard_uncertainty)
        notes.append(f"rotation vector of the IMU against the body frame: ({_with_error(angles, errors)})°")
    return notes


def _with_error(values: np.ndarray, errors: np.ndarray) -> str:
    return ", ".join(f"{value:.3f} ± {error:.3f}" for value, error in zip(values, errors, strict=True))


def _and(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
