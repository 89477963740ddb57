"""One run's own estimate, what was used of it, and its load cell's offsets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identify.least_squares.offsets import Offsets, force_offset, uncertainty
from identify.least_squares.residual_spectrum import Trace
from identify.least_squares.run_information import Information
from identify.rigid_body.inertial_parameters import by_component


@dataclass(frozen=True, repr=False)
class RunEstimate:
    """One run's own estimate."""

    file: str
    sha256: str | None
    inertia: np.ndarray
    """Packed tensor from this run alone [kg·m²]."""
    standard_uncertainty: np.ndarray
    """Standard uncertainty of ``inertia`` from the run's residuals [kg·m²]."""
    samples: int
    rate: float
    """Sample rate of the run [Hz]."""
    residual: np.ndarray
    """Standard deviation of the residual moment on each axis [N·m]."""
    correlation_time: float
    """Integrated correlation time of the residuals [s]."""
    offsets: Offsets | None
    """Constants of the load cell that were removed; None: not asked for."""
    alone: bool
    """Whether this run identifies the whole tensor by itself."""
    segments: tuple[tuple[float, float], ...] = ()
    """Start and end of each part of the run that was used [s]; empty: the whole run was."""
    detected: bool = False
    """Whether ``segments`` were detected by the motion rather than named."""
    left_out: Mapping[str, int] = field(default_factory=dict)
    """Number of samples that were left out, by reason."""
    overview: np.ndarray | None = None
    """Time and largest angular velocity of the whole run that the segments were cut from [s, rad/s]."""
    force_offset: np.ndarray | None = None
    """The force's offset [N]; None where neither mass nor accelerometer determines it."""
    r_cg: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Centre of gravity from this run alone, (3,) [m]; empty: it counts as stated."""
    sigma_r_cg: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Standard uncertainty of ``r_cg`` [m]."""
    mounting: str | None = None
    """Name of the mounting of the body; None: not declared."""
    weight: float = 1.0
    """Inverse of the rows' effective noise variance, which weighs it among the runs [(N·m)⁻²]."""
    trace: Trace | None = None
    """Residuals and motion, for figures; None: absent."""
    weighed: np.ndarray | None = None
    """Rows that the equations were made with; see :class:`identify.least_squares.run_information.Information`."""

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it, in SI."""
        return {
            "file": self.file,
            "sha256": self.sha256,
            "inertia": by_component(self.inertia) if self.alone else None,
            "standard_uncertainty": by_component(self.standard_uncertainty) if self.alone else None,
            "samples": self.samples,
            "rate": self.rate,
            "residual": self.residual.tolist(),
            "correlation_time": self.correlation_time,
            "mounting": self.mounting,
            "parts": [list(segment) for segment in self.segments],
            "parts_found": self.detected,
            "left_out": dict(self.left_out),
        }

    def __repr__(self) -> str:
        return f"RunEstimate({self.file!r}: {self.samples:,} samples, {self.rate:.6g} Hz)"


def run_estimate(information: Information, r_cg: np.ndarray, mass: float | None) -> RunEstimate:
    """Return a run's own estimate; ``mass`` [kg], where stated, determines the force's offset."""
    run = information.run
    return RunEstimate(
        file=run.name, sha256=run.sha256, inertia=information.inertia,
        standard_uncertainty=np.sqrt(np.diag(information.covariance)), samples=information.rows, rate=run.rate,
        residual=information.residual, correlation_time=information.correlation_time / run.rate,
        offsets=information.offsets, alone=bool(information.excitation.identifiable.all()), segments=run.segments,
        detected=run.detected, left_out=run.left_out, overview=run.overview,
        force_offset=None if information.offsets is None else force_offset(run, r_cg, mass), mounting=run.mounting,
        weight=information.weight, trace=information.trace, weighed=information.weighed,
    )  # fmt: skip


def offsets_content(runs: Sequence[RunEstimate], sigma_r_cg: np.ndarray, r_cg: np.ndarray) -> dict[str, Any]:
    """Return the runs' offsets for result.json, one entry per run [N, N·m]."""

    def listed(values: np.ndarray | None) -> list[float] | None:
        return None if values is None else values.tolist()

    def at_q(run: RunEstimate) -> np.ndarray | None:
        if run.offsets is None or run.force_offset is None:
            return None
        return run.offsets.moment + np.cross(r_cg, run.force_offset)

    return {
        "moment": [listed(run.offsets and run.offsets.moment) for run in runs],
        "moment_standard_uncertainty": [listed(run.offsets and uncertainty(run.offsets, sigma_r_cg)) for run in runs],
        "force": [listed(run.force_offset) for run in runs],
        "moment_about_q": [listed(at_q(run)) for run in runs],
    }
