"""Local gravity from latitude and height: the normal gravity of the WGS 84 ellipsoid."""

import math

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity [m/s²].

Definition: CGPM 1901.
"""
EQUATOR = 9.7803253359
"""Normal gravity at the equator [m/s²]."""
SOMIGLIANA = 0.00193185265241
"""Constant k of Somigliana's formula."""
ECCENTRICITY_SQUARED = 0.00669437999014
SEMI_MAJOR = 6_378_137.0
"""Semi-major axis of the ellipsoid [m]."""
FLATTENING = 1 / 298.257223563
CENTRIFUGAL = 0.00344978650684
"""Ratio ω²a²b/GM of centrifugal to gravitational acceleration at the equator."""


def normal_gravity(latitude: float, height: float = 0.0) -> float:
    """Return the normal gravity [m/s²] at a geodetic latitude [rad] and a height over the ellipsoid [m].

    Somigliana's formula on the ellipsoid, and its expansion to second order in the height over it (free air). Real
    gravity departs from it by anomalies, of 0.001 m/s² in most places; a measured value is better.

    Reference: NIMA TR8350.2, World Geodetic System 1984, 3rd ed. (2000), equations 4-1 and 4-3.
    """
    s = math.sin(latitude) ** 2
    on_ellipsoid = EQUATOR * (1 + SOMIGLIANA * s) / math.sqrt(1 - ECCENTRICITY_SQUARED * s)
    slope = 2 / SEMI_MAJOR * (1 + FLATTENING + CENTRIFUGAL - 2 * FLATTENING * s)
    return on_ellipsoid * (1 - slope * height + 3 / SEMI_MAJOR**2 * height**2)
