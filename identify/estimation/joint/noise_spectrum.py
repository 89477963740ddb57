"""Noise of the joint estimate's rows line by line, and what the rows tell of the unknowns in it.

Rows are weighed by the mean level of their noise over the band: least squares, which rest on the products ``Xᵀ r`` of
columns and residuals. In white noise these have the covariance ``I = Xᵀ X``; in noise of a spectrum S, which may be
stronger where the motion is than in the mean over a band five times as wide, ``J = Σ Xᵀ S X`` over the lines of the
cosine transform. So the rows tell ``I J⁻¹ I`` of the unknowns, the inverse of White's covariance ``I⁻¹ J I⁻¹`` (1980,
doi:10.2307/1912934), and beside priors and other runs the equations count as much (generalised method of moments:
Hansen 1982, doi:10.2307/1912775).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from identify.least_squares.residual_spectrum import Spectrum, leverage, spectrum
from identify.least_squares.row_products import inverse, products

SEEN = 1e-12
"""Part of the information on the best known direction below which one is not seen."""

ROUNDING = 1e-12
"""Size of a column over the largest one's below which it is rounding: its direction changes at each step."""


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Spectrum of the noise of a run's rows, on the lines of the band; in units of its mean level."""

    spectrum: Spectrum
    least: Float[np.ndarray, "rows rows"]
    """Covariance that all lines have at least."""
    independent: bool
    """Whether each row has its own noise."""

    @property
    def values(self) -> Float[np.ndarray, "m rows rows"]:
        """Covariance of the rows on each line."""
        values = self.spectrum.values
        return (values * np.eye(len(self.least)) if self.independent else values) + self.least

    def weights(self, columns: Float[np.ndarray, "n rows p"]) -> Float[np.ndarray, "p p"]:
        """Return ``I J⁻¹`` of lines of columns, by which least squares' equations count beside priors.

        Directions that the rows do not see keep the weight that they have in white noise, as lines above the band do.
        """
        # in the eigenvectors of I, which is then a unit matrix, J is one and what S adds: no difference of large terms
        normal, inside = products(columns, columns), columns[: len(self.spectrum.shape)]
        squares = np.diag(normal)
        scale = 1 / np.sqrt(np.where(squares > ROUNDING**2 * squares.max(), squares, 1.0))
        values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
        seen = values > SEEN * values[-1]
        root, vectors = np.sqrt(values[seen]), vectors[:, seen]
        basis = inside @ (scale[:, None] * vectors / root)  # orthonormal over all lines
        excess = products(basis, self.values @ basis - basis)
        identity = np.eye(len(root))
        # I J⁻¹ - 1 in that basis; back in the columns' own it is a change of the unit matrix, small where the noise is
        # white
        middle = np.linalg.inv(identity + (excess + excess.T) / 2) - identity
        change = (vectors * root) @ middle @ (vectors / root).T
        return np.asarray(np.eye(len(scale)) + change * scale / scale[:, None])

    def degrees_of_freedom(
        self, columns: Float[np.ndarray, "n rows p"], gain: Float[np.ndarray, "p k"]
    ) -> Float[np.ndarray, " k"]:
        """Return the effective degrees of freedom of the variances of ``gainᵀ Xᵀ r``."""
        columns = columns[: len(self.spectrum.shape)]
        return self.spectrum.degrees_of_freedom(columns, gain, self.spectrum.scores(columns))


def noise_spectrum(
    residuals: Float[np.ndarray, "n rows"], columns: Float[np.ndarray, "n rows p"], precision: Float[np.ndarray, " p"],
    least: Float[np.ndarray, "rows rows"], *, inside: int, constants: int = 1, independent: bool,
) -> NoiseSpectrum:  # fmt: skip
    """Return the spectrum of residuals.

    Args:
        residuals: on lines of the cosine transform, in units of their mean level.
        columns: of the unknowns that were fitted, in the same units.
        precision: of their priors.
        least: covariance that the noise has at least, in the same units.
        inside: number of lines in the band, the first ones.
        constants: how many lines, the first ones, are those of constants.
        independent: whether each row has its own noise.
    """
    inside = max(inside, constants + 1)
    free = 1 - leverage(columns[:inside], inverse(products(columns, columns) + np.diag(precision)))
    return NoiseSpectrum(spectrum(residuals[:inside], free, constants), least, independent)
