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
    """Root mean square of measured less predicted values in the motion's band [N], [N·m]."""
    noise: Float[np.ndarray, " rows"]
    """Part of ``rms`` that the measurement noise explains [N], [N·m]."""
    of_estimate: Float[np.ndarray, " rows"]
    """Part of ``rms`` that the uncertainty of the estimate explains [N], [N·m]."""
    measured_rms: Float[np.ndarray, " rows"]
    """Root mean square of the measured values about their mean [N], [N·m]."""
    degrees_of_freedom: Float[np.ndarray, " rows"]
    """Effective degrees of freedom of the square of ``rms``."""
    noise_degrees_of_freedom: Float[np.ndarray, " rows"]
    """Degrees of freedom of the noise level, which the other runs' residuals show."""
    probability: Float[np.ndarray, " rows"]
    """Probability of an error at least as large by chance."""
    body_ratio: float
    """Ratio of the error to its expected size (rms) along directions that another body's parameters would cause."""
    body_probability: float
    """Probability of a ratio at least as large as ``body_ratio`` by chance."""
    t: Float[np.ndarray, " n"]
    """Instants of a short stretch [s]."""
    measured: Float[np.ndarray, "n rows"]
    """Measured values in the motion's band over the short stretch [N], [N·m]."""
    predicted: Float[np.ndarray, "n rows"]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows: force and moment, or the moment about the centre of gravity alone."""
        return (*FORCE, *MOMENT) if len(self.rms) > len(MOMENT) else MOMENT

    @property
    def expected(self) -> np.ndarray:
        """Root mean square that noise and the estimate's uncertainty explain together [N], [N·m]."""
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
