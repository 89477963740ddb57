"""One run, or half of one, as the others predict it: errors by axis beside what explains them, and a stretch of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.reporting import plain

FORCE, MOMENT = ("F1", "F2", "F3"), ("M1", "M2", "M3")


@dataclass(frozen=True, eq=False)
class HeldOutRun:
    """A run, or half of one, as predicted by the others. By row: force and moment about Q, or moment about the CG."""

    file: str
    rms: Float[np.ndarray, " rows"]
    """Of measured less predicted, in the motion's band [N], [N·m]."""
    noise: Float[np.ndarray, " rows"]
    """What noise explains of it."""
    of_estimate: Float[np.ndarray, " rows"]
    """What the estimate's own uncertainty explains of it."""
    measured_rms: Float[np.ndarray, " rows"]
    """Of what was measured, about its mean."""
    degrees_of_freedom: Float[np.ndarray, " rows"]
    """Effective, of the square of ``rms``."""
    noise_degrees_of_freedom: Float[np.ndarray, " rows"]
    """Of the noise, which the other runs' residuals show."""
    probability: Float[np.ndarray, " rows"]
    """Of an error as large or larger by chance."""
    body_ratio: float
    """Along what another body would do: root mean square over what is to be expected."""
    body_probability: float
    """Of as much or more by chance."""
    t: Float[np.ndarray, " n"]
    """Instants of a short stretch [s]."""
    measured: Float[np.ndarray, "n rows"]
    """In the motion's band."""
    predicted: Float[np.ndarray, "n rows"]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the rows."""
        return (*FORCE, *MOMENT) if len(self.rms) > len(MOMENT) else MOMENT

    @property
    def expected(self) -> np.ndarray:
        """What noise and the estimate's uncertainty explain together [N], [N·m]."""
        return np.hypot(self.noise, self.of_estimate)

    @property
    def ratio(self) -> np.ndarray:
        """Error over what is expected."""
        return self.rms / np.maximum(self.expected, 1e-300)

    @property
    def least(self) -> tuple[float, str]:
        """The least probability, and of what: a row, or "body"."""
        every = dict(zip(self.names, map(float, self.probability), strict=True)) | {"body": self.body_probability}
        name = min(every, key=lambda key: every[key])
        return every[name], name

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it."""
        keys = ("rms", "noise", "of_estimate", "expected", "ratio", "degrees_of_freedom", "probability")
        return {
            "file": self.file,
            **{key: dict(zip(self.names, plain(getattr(self, key)), strict=True)) for key in keys},
            "body_ratio": plain(self.body_ratio),
            "body_probability": plain(self.body_probability),
        }
