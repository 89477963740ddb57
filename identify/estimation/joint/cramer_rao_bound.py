"""The hybrid Cramér–Rao bound: what no estimator can beat, given the noise and the priors.

The inverse of the samples' Fisher information plus the precision of the priors, over every unknown that is left free
(van Trees, Detection, Estimation, and Modulation Theory I, 2.4.3). For priors drawn in each experiment it bounds
the mean square of the errors. The true angular velocity counts as exact once smoothed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.display.reporting import Result
from identify.estimation.joint.gauss_newton import information, posterior
from identify.estimation.joint.joint_model import SIZES, SLICES, SpecificForce
from identify.estimation.joint.priors import STATIC, Alignment, PriorBlock, Setting
from identify.estimation.joint.single_run import REACH, prepared, whitener
from identify.exceptions import explains_names
from identify.rigid_body.inertia import COMPONENTS, MOMENTS, PRODUCTS, Body
from identify.rigid_body.inertial_parameters import by_component
from identify.rigid_body.regressor import cross_matrix
from identify.signals.band_limited_run import in_band
from identify.signals.run import Run


@dataclass(frozen=True, repr=False)
class Bound(Result):
    """The least covariance that an unbiased estimate can have.

    Example: ``bound(run, body, ...).to_frame()`` has the least standard uncertainty of each component.
    """

    unit_of_columns = "kg·m²"

    free: tuple[str, ...]
    """The unknowns that are estimated; all others count as exact."""
    covariance: np.ndarray
    """Covariance of all unknowns, in the order of ``SLICES`` of the joint model; zero for exact ones."""
    prior_share: Mapping[str, np.ndarray]
    """Share of the prior in each unknown's variance, by unknown: 1 where the samples add nothing."""

    def standard_uncertainty(self, name: str) -> np.ndarray:
        """Return the least standard uncertainty of an unknown, such as ``inertia``, ``r_cg``, ``delay``, in SI."""
        return np.sqrt(np.diag(self.covariance)[SLICES[name]])

    @property
    def three_sigma(self) -> tuple[float, float]:
        """Three standard uncertainties [kg·m²], average of the three moments and of the three products."""
        three = 3 * self.standard_uncertainty("inertia")
        return float(three[list(MOMENTS)].mean()), float(three[list(PRODUCTS)].mean())

    def to_dict(self) -> dict[str, Any]:
        """Return the bound in SI."""
        return {
            "free": list(self.free),
            "inertia": by_component(self.standard_uncertainty("inertia")),
            "standard_uncertainty": {name: self.standard_uncertainty(name).tolist() for name in self.free},
            "prior_share": {name: share.tolist() for name, share in self.prior_share.items()},
        }

    def records(self) -> list[dict[str, Any]]:
        """Return the least standard uncertainty of each component [kg·m²]."""
        pairs = zip(COMPONENTS, self.standard_uncertainty("inertia"), strict=True)
        return [{"component": name, "standard_uncertainty": u} for name, u in pairs]


@explains_names
def bound(
    run: Run,
    body: Body,
    *,
    band: float,
    noise: np.ndarray,
    gyro_noise: np.ndarray,
    static_covariance: np.ndarray,
    alignment: Alignment,
    specific_force: SpecificForce = "still",
    sigma_still: float | np.ndarray = 0.0,
    gravity: float = 9.80665,
) -> Bound:
    """Return the bound of an experiment.

    Args:
        run: its signals without errors.
        body: the body that made them.
        band: highest frequency of the motion [Hz].
        noise: standard deviation of one sample's white noise: force [N], moment [N·m], shape (6,).
        gyro_noise: that of the gyro [rad/s], shape (3,).
        static_covariance: prior covariance of mass, r_CG and the offsets of force and moment, (10, 10) [kg, m, N, N·m].
        alignment: prior standard uncertainties of delay, rotation, gyro's zero and tilt; 0: exact.
        specific_force: where it comes from; an accelerometer counts as free of noise, but for its zero.
        sigma_still: prior standard uncertainty of the point at rest, from the centre of gravity [m].
        gravity: local gravity [m/s²].

    Raises:
        RunError: the run is too short.
    """
    static = np.concatenate([[float(body.mass)], np.asarray(body.r_cg_from_q), np.zeros(6)])
    scale = float(np.abs(np.asarray(body.inertia)).max())
    still = PriorBlock(np.zeros(3), np.diag(np.broadcast_to(np.square(sigma_still), 3)))
    blocks = {STATIC: PriorBlock(static, static_covariance), ("cg_from_still",): still}
    setting = Setting(
        blocks=blocks, alignment=alignment, band=band, specific_force=specific_force, gravity=gravity, scale=scale
    )
    reach = abs(alignment.delay) + REACH * alignment.sigma_delay
    rows = in_band(run, band, reach=reach, accelerometer=specific_force == "accelerometer")
    model, prior = prepared(rows, np.asarray(gyro_noise) / np.sqrt(run.rate), run.accelerometer_position, setting)
    z = prior.coordinates({"inertia": np.asarray(body.inertia)})
    white = _whitener(body, noise, rows.factor, specific_force)
    # Fisher's information of normal rows is XᵀX, and the prior's adds to it (Van Trees' Bayesian bound)
    covariance, by_prior = posterior(information(model, prior, white, z), prior)
    total = np.diag(covariance)
    shares = np.diag(by_prior) / np.where(total > 0, total, 1.0)
    free = tuple(name for name in SIZES if (total[SLICES[name]] > 0).any())
    return Bound(free, covariance, {name: shares[SLICES[name]] for name in free})


def _whitener(body: Body, noise: np.ndarray, factor: int, specific_force: SpecificForce) -> np.ndarray:
    """Whitener of the rows' noise; without a specific force, the measured force's noise enters with the lever r."""
    covariance = np.diag(np.square(noise)) / factor
    if specific_force != "none":
        return whitener(covariance)
    arm = cross_matrix(np.asarray(body.r_cg_from_q))
    return whitener(covariance[3:, 3:] + arm @ covariance[:3, :3] @ arm.T)
