"""Other conventions of a reference's figures that would explain a deviation: signs, point, axes, unit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations, product

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from identify.rigid_body.inertia import COMPONENTS, ENTRIES, parallel_axis
from identify.rigid_body.inertial_parameters import Tensor
from uq.bodies.normalised_error import joint_chi_squared, normalised_error
from uq.bodies.reference import SIGNS, Reference

REJECTED = 0.01
"""Probability of the joint chi-squared below which a deviation is more than chance."""
VANISHED, SMALLER = 0.1, 1 / 3
"""Part of the deviation that may be left: where it is still beyond the uncertainties, and where it is within them."""
UNITS = {
    1e-9: "g·mm² for kg·m²", 1e-6: "kg·mm² for kg·m²", 1e-3: "g·m² for kg·m²", 1e3: "kg·m² for g·m²",
    1e6: "kg·m² for kg·mm²", 1e9: "kg·m² for g·mm²", 2.9263965e-4: "lb·in² for kg·m²", 4.2140110e-2: "lb·ft² for kg·m²",
}  # fmt: skip
"""Factors on the figures for a unit that was written in place of another."""

SLIPS = (-1.0, 10.0, 0.1, 100.0, 0.01, 1e3, 1e-3)
"""Factors of a sign or of a decimal point."""


@dataclass(frozen=True)
class Suspicion:
    """A convention under which a deviation vanishes."""

    cause: str
    """Kind of the convention: products, point, products and point, axes, unit, or slip."""
    text: str
    """Description of the convention in words, with what to change."""
    remaining: float
    """Part of the deviation that it leaves, in the Frobenius norm."""


@dataclass(frozen=True)
class _Candidate:
    cause: str
    text: str
    tensor: Tensor
    """Tensor of the reference under the candidate convention."""
    moved: int = 0
    """Number of axes with another name or sign; among equal candidates the smallest number wins."""


def suspicions(measured: Tensor, reference: Reference) -> tuple[Suspicion, ...]:
    """Return the conventions of a reference's figures that would make its deviation from a measurement vanish.

    A convention is named only if the deviation is beyond the uncertainties as the figures stand (some |E_n| > 1, joint
    probability below ``REJECTED``), and under it either no |E_n| is above 1 and at most a third of the deviation is
    left, or less than a tenth. Conventions that change nothing, such as signs of products that are zero, are therefore
    never named. Of several assignments of axes the simplest is named.

    Args:
        measured: the measured tensor about the centre of gravity, in B.
        reference: what is expected.
    """
    expected = reference.parameters.tensor
    beyond = (np.abs(normalised_error(measured, expected)) > 1).any()
    exact = not np.diag(measured.covariance + expected.covariance).any()
    if not (beyond and (exact or joint_chi_squared(measured, expected)[2] < REJECTED)):
        return ()
    before = _norm(measured.inertia - expected.inertia)
    candidates = []
    report = (
        [*_signs_and_points(reference), *_units(reference), *_slips(reference)]
        if reference.kind == "CAD report"
        else []
    )
    for candidate in (*report, *_axes(reference)):
        remaining = _norm(measured.inertia - candidate.tensor.inertia) / before
        within = (np.abs(normalised_error(measured, candidate.tensor)) <= 1).all()
        if remaining < VANISHED or (within and remaining < SMALLER):
            candidates.append((candidate, remaining))
    return _simplest(candidates)


def _norm(packed: np.ndarray) -> float:
    return float(np.sqrt(ENTRIES @ packed**2))


def _simplest(candidates: Sequence[tuple[_Candidate, float]]) -> tuple[Suspicion, ...]:
    """One for each cause; two causes together only where neither alone will do."""
    best: dict[str, tuple[_Candidate, float]] = {}
    for candidate, remaining in sorted(candidates, key=lambda pair: (pair[0].moved, pair[1])):
        best.setdefault(candidate.cause, (candidate, remaining))
    if {"products", "point"} & set(best):
        best.pop(BOTH, None)
    return tuple(Suspicion(cause, candidate.text, remaining) for cause, (candidate, remaining) in best.items())


# --- the conventions ---

BOTH = "products and point"


def _signs_and_points(reference: Reference) -> list[_Candidate]:
    other = {"tensor": "integral", "integral": "tensor"}[reference.products]
    point = {"CG": "origin", "origin": "CG"}[reference.about]
    rotation = reference.rotation
    flip = _map(rotation) @ np.diag(SIGNS) @ _map(rotation.T)
    signs = f'its products have the other sign: try products = "{other}"'
    about = f'its figures are about the other point: try about = "{point}"'
    both = f'its products have the other sign and its figures are about the other point: try "{other}" and "{point}"'
    candidates = [_Candidate("products", signs, _as_meant(reference, flip, reference.about))]
    if np.isfinite(reference.parameters.values).all():
        candidates.append(_Candidate("point", about, _as_meant(reference, np.eye(6), point)))
        candidates.append(_Candidate(BOTH, both, _as_meant(reference, flip, point)))
    return candidates


def _units(reference: Reference) -> list[_Candidate]:
    return [
        _Candidate(
            "unit",
            f"its figures agree when multiplied by {factor:.4g}: is the unit wrong ({name})?",
            _as_meant(reference, factor * np.eye(6), reference.about),
        )
        for factor, name in UNITS.items()
    ]


def _slips(reference: Reference) -> list[_Candidate]:
    """A single figure with another sign, or with its decimal point elsewhere."""
    into, back = _map(reference.rotation), _map(reference.rotation.T)
    candidates = []
    for (k, name), factor in product(enumerate(COMPONENTS), SLIPS):
        change = into @ np.diag(np.where(np.arange(6) == k, factor, 1.0)) @ back
        text = f"its {name} is multiplied by {factor:g}: a slip of sign or decimal point?"
        candidates.append(_Candidate("slip", text, _as_meant(reference, change, reference.about)))
    return candidates


def _as_meant(reference: Reference, change: np.ndarray, about: str) -> Tensor:
    """The tensor about the centre of gravity had the report's figures been changed so, and meant about this point."""
    ten = reference.parameters
    if about == reference.about == "CG":
        return _linear(change, ten.tensor)
    given = (jnp.asarray(ten.values), jnp.asarray(change), jnp.asarray(reference.origin))
    value, jacobian = map(np.asarray, _meant(*given, stated_about=reference.about, about=about))
    return Tensor(value, jacobian @ ten.covariance @ jacobian.T)


@partial(jax.jit, static_argnames=("stated_about", "about"))
def _meant(values: Array, change: Array, origin: Array, *, stated_about: str, about: str) -> tuple[Array, Array]:
    """Return the meant tensor and its derivative by the ten parameters, read as the report is said to be written."""

    def tensor(values: Array) -> Array:
        mass, arm, inertia = values[0], values[1:4] - origin, values[4:]
        written = parallel_axis(inertia, mass, arm) if stated_about == "origin" else inertia
        changed = change @ written
        return parallel_axis(changed, -mass, arm) if about == "origin" else changed

    return tensor(values), jax.jacfwd(tensor)(values)


def _linear(change: np.ndarray, tensor: Tensor) -> Tensor:
    return Tensor(change @ tensor.inertia, change @ tensor.covariance @ change.T)


def _map(rotation: np.ndarray) -> np.ndarray:
    """The matrix that turns packed tensors."""
    rows, columns = np.triu_indices(3)
    basis = np.zeros((6, 3, 3))
    basis[np.arange(6), rows, columns] = basis[np.arange(6), columns, rows] = 1
    return (rotation @ basis @ rotation.T)[:, rows, columns].T


def _axes(reference: Reference) -> list[_Candidate]:
    """The 23 other right-handed assignments of the drawing's axes."""
    rotation, tensor, candidates = reference.rotation, reference.parameters.tensor, []
    for turn in _quarter_turns():
        change = _map(rotation @ turn @ rotation.T)
        text = f"its axes have other names or signs: try {_declared(rotation @ turn)}"
        candidates.append(_Candidate("axes", text, _linear(change, tensor), int(3 - (np.diag(turn) == 1).sum())))
    return candidates


def _quarter_turns() -> list[np.ndarray]:
    matrices = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.diag(signs)[:, list(order)]
        if np.linalg.det(matrix) > 0 and not np.array_equal(matrix, np.eye(3)):
            matrices.append(matrix)
    return matrices


def _declared(rotation: np.ndarray) -> str:
    """A rotation as a file declares it: signed axes where it is made of them."""
    if np.allclose(np.abs(rotation).max(axis=1), 1, atol=1e-9):
        words = [("-" if row[k] < 0 else "") + "xyz"[k] for row in rotation for k in [int(np.abs(row).argmax())]]
        return f'rotation_to_body = "{", ".join(words)}"'
    rows = ", ".join("[" + ", ".join(f"{value:.4g}" for value in row) + "]" for row in rotation + 0.0)
    return f"rotation_to_body = [{rows}]"
