"""Excitation: which directions of the tensor a motion tells, and which it leaves to noise."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import COMPONENTS

Matrix = Float[Array, "6 6"] | Float[np.ndarray, "6 6"]


class Excitation(NamedTuple):
    """The motion's information on the six components: the verdict on identifiability."""

    strength: np.ndarray
    """Eigenvalues of ``ΩᵀΩ``, ascending [s⁻⁴ times the number of samples]."""
    directions: np.ndarray
    """Unit eigenvectors of ``ΩᵀΩ`` in the space of packed tensors, one a row."""
    noise: np.ndarray
    """Expected part of each eigenvalue that the gyro's noise alone contributes."""
    identifiable: np.ndarray
    """Mask of the directions that stand out from noise and rounding."""

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the components that lie, for the greater part, in directions that the motion does not excite."""
        blind = self.directions[~self.identifiable]
        return tuple(name for name, share in zip(COMPONENTS, (blind**2).sum(axis=0), strict=True) if share > 0.4)

    @property
    def blind_direction(self) -> str:
        """The least excited direction in words, such as ``0.58 I11 +0.58 I22 +0.58 I33``."""
        shares = zip(COMPONENTS, self.directions[0], strict=True)
        return " ".join(f"{share:+.2g} {name}" for name, share in shares if abs(share) > 0.1).removeprefix("+")


def excitation(normal: Matrix, noise: Matrix) -> Excitation:
    """Judge which directions of the tensor a motion excites.

    A direction counts as identifiable when its strength is at least ten times what the gyro's noise contributes (less
    would dilute the estimate by more than a tenth) and above 1e-9 of the strongest.

    Args:
        normal: ``ΩᵀΩ``.
        noise: the expected contribution of the gyro's noise to it; zeros when there is none.
    """
    strength, vectors = np.linalg.eigh(np.asarray(normal, float))
    directions = vectors.T
    noise_strength = np.einsum("ki,ij,kj->k", directions, np.asarray(noise, float), directions)
    identifiable = (strength > 10 * noise_strength) & (strength > 1e-9 * strength[-1])
    return Excitation(strength, directions, noise_strength, identifiable)
