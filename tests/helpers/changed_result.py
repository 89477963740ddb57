"""An identification with other figures: what a test changes of the ten parameters, their covariance and intervals."""

from dataclasses import replace
from typing import Any

import numpy as np

from identify.results.identification_result import Identification


def changed(result: Identification, **figures: Any) -> Identification:
    """Return a result with other values (``mass``, ``r_cg``, ``inertia``), covariances or intervals of its own units.

    Args:
        result: an identification.
        figures: ``covariance`` and ``interval95`` of the tensor, ``covariance_of_ten``, ``intervals95``, ``sigma_r_cg``
            and ``mass_uncertainty`` (uncorrelated), or a value.
    """
    ten, intervals = result.parameters, result.intervals95.copy()
    covariance = np.array(figures.pop("covariance_of_ten", ten.covariance))
    if "covariance" in figures:
        covariance[4:, 4:] = figures.pop("covariance")
    if "sigma_r_cg" in figures:
        covariance[1:4, 1:4] = np.diag(np.square(figures.pop("sigma_r_cg")))
    if "mass_uncertainty" in figures:
        covariance[0] = covariance[:, 0] = 0.0
        covariance[0, 0] = (figures.pop("mass_uncertainty") or 0.0) ** 2
    if "interval95" in figures:
        intervals[4:] = figures.pop("interval95")
    intervals = figures.pop("intervals95", intervals)
    return replace(result, parameters=replace(ten, covariance=covariance, **figures), intervals95=intervals)
