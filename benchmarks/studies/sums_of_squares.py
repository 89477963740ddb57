"""How large the mean square of a signal of limited band can be: a bound that carries its own proof.

Take a signal x of band B with ``|x| ≤ 1`` whose integral keeps within ±``ratio``, time counted in 1/Ω, Ω = 2πB. Write
``z₀`` for the integral over ``ratio`` and ``z₁ … z_N`` for x and its derivatives. Each is of band B and at most one;
by Bernstein's inequality in Szegő's form ``z_k² + z_{k+1}² ≤ 1`` for k ≥ 1. Let V be a polynomial of ``z₀ … z_{N-1}``:
its derivative LV has mean zero from rest to rest, and in the long run, since V is bounded. If

    ρ - z₁² - LV(z) = σ(z) + Σ_k σ_k(z) g_k(z),    σ, σ_k sums of squares, g_k ≥ 0 the inequalities above,

then the mean of x² is at most ρ. The least such ρ is a semidefinite programme (Parrilo 2003,
doi:10.1007/s10107-003-0387-5; Fantuzzi, Goluskin, Huang and Chernyshenko 2016, doi:10.1137/15M1053347, bound time
averages so). What rounding leaves of the identity is added: on these signals no product of the z exceeds one.
"""

from collections.abc import Iterator, Mapping
from functools import cache

import clarabel
import numpy as np
from jaxtyping import Float
from scipy import sparse

WEIGHTS = (1, 1, 1, 1, 1, 1, 1.5, 1.5, 2, 2, 2)
"""What a factor z_k adds to the degree of a monomial: high derivatives help, but not in high powers."""
HALF = 3.0
"""Degree, so weighted, of the polynomials whose squares are summed: half of the identity's."""
TOLERANCE = 1e-7
"""Of the solver; what it leaves is counted in any case."""

Exponents = tuple[int, ...]
Polynomial = Mapping[Exponents, float]


@cache
def mean_square_bound(ratio: float) -> float:
    """Return what the mean square cannot exceed, at most one.

    Args:
        ratio: largest modulus of the signal's integral over what a bound of one and the band's edge give, ``2πB v / a``
            for ``|x| ≤ a`` and ``|∫x| ≤ v``; at least one.
    """
    programme = _Programme(ratio)
    found = programme.solved()
    return min(1.0, programme.certified(found)) if np.isfinite(found).all() else 1.0


class _Programme:
    """The identity's coefficients as linear equations of ρ, of V's coefficients and of the squares' Gram matrices."""

    def __init__(self, ratio: float) -> None:
        self.ratio, size = ratio, len(WEIGHTS)
        roots = _classes(HALF)
        self.row = {m: k for k, m in enumerate(sorted({_times(a, b) for own in roots for a in own for b in own}))}
        self.sizes, columns = [], []
        for factor, most in self._inequalities():
            for own in _classes(most):
                self.sizes.append(len(own))
                columns.append(self._of_gram(factor, own))
        self.functions = [m for m in _monomials(2 * HALF) if self._may_be_in_v(m)]
        derived = sparse.hstack([self._column(self._derivative(m)) for m in self.functions])
        self.free = 1 + len(self.functions)
        one = self._column({(0,) * size: 1.0})
        self.equations = sparse.hstack([one, -derived, *(-block for block in columns)]).tocsc()
        self.wanted = self._column({tuple(2 * (k == 1) for k in range(size)): 1.0}).toarray().ravel()

    @staticmethod
    def _inequalities() -> Iterator[tuple[Polynomial, float]]:
        """Yield one and every g, with what the roots of the squares beside it may count."""
        size = len(WEIGHTS)
        square = [tuple(2 * (k == i) for k in range(size)) for i in range(size)]
        one = {(0,) * size: 1.0}
        yield one, HALF
        yield one | {square[0]: -1.0}, HALF - WEIGHTS[0]
        for k in range(1, size - 1):
            yield one | {square[k]: -1.0, square[k + 1]: -1.0}, HALF - max(WEIGHTS[k], WEIGHTS[k + 1])

    def _may_be_in_v(self, monomial: Exponents) -> bool:
        """Odd under reversed time and even under a change of sign, as the best V is; its derivative in the identity."""
        even = sum(monomial) % 2 == 0 and monomial[-1] == 0
        return even and _under_reversal(monomial) == -1 and all(m in self.row for m in self._derivative(monomial))

    def _derivative(self, monomial: Exponents) -> dict[Exponents, float]:
        found: dict[Exponents, float] = {}
        for k, power in enumerate(monomial[:-1]):
            if power:
                moved = list(monomial)
                moved[k] -= 1
                moved[k + 1] += 1
                found[tuple(moved)] = power / (self.ratio if k == 0 else 1.0)
        return found

    def _column(self, polynomial: Polynomial) -> sparse.csc_matrix:
        rows = [self.row[m] for m in polynomial]
        return sparse.csc_matrix((list(polynomial.values()), (rows, [0] * len(rows))), shape=(len(self.row), 1))

    def _of_gram(self, factor: Polynomial, roots: list[Exponents]) -> sparse.csc_matrix:
        """Coefficients of ``factor · mᵀ Q m`` by Q's upper triangle, column by column, off the diagonal times √2."""
        rows, columns, values = [], [], []
        for j, b in enumerate(roots):
            for i, a in enumerate(roots[: j + 1]):
                for monomial, coefficient in factor.items():
                    rows.append(self.row[_times(_times(a, b), monomial)])
                    columns.append(j * (j + 1) // 2 + i)
                    values.append(coefficient * (1.0 if i == j else np.sqrt(2.0)))
        return sparse.csc_matrix((values, (rows, columns)), shape=(len(self.row), len(roots) * (len(roots) + 1) // 2))

    def solved(self) -> Float[np.ndarray, " unknowns"]:
        """Return ρ, V's coefficients and the Gram matrices as the solver leaves them."""
        equations, unknowns = self.equations.shape
        grams = sparse.hstack([sparse.csc_matrix((unknowns - self.free, self.free)), -sparse.eye(unknowns - self.free)])
        cones = [clarabel.ZeroConeT(equations), *map(clarabel.PSDTriangleConeT, self.sizes)]
        cost = np.zeros(unknowns)
        cost[0] = 1.0
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix((unknowns, unknowns)), cost, sparse.vstack([self.equations, grams]).tocsc(),
            np.concatenate([self.wanted, np.zeros(unknowns - self.free)]), cones, settings,
        )  # fmt: skip
        return np.array(solver.solve().x)

    def certified(self, unknowns: Float[np.ndarray, " unknowns"]) -> float:
        """Return a ρ that is proved: Gram matrices made definite, and what the identity lacks added to it."""
        proved, place = unknowns.copy(), self.free
        for size in self.sizes:
            stop = place + size * (size + 1) // 2
            proved[place:stop] = _definite(proved[place:stop], size)
            place = stop
        return float(proved[0] + np.abs(self.equations @ proved - self.wanted).sum())


def _definite(triangle: Float[np.ndarray, " t"], size: int) -> Float[np.ndarray, " t"]:
    """Return the nearest matrix of no negative eigenvalue, as its scaled upper triangle column by column."""
    column, row = np.tril_indices(size)
    scale = np.where(row == column, 1.0, np.sqrt(2.0))
    matrix = np.zeros((size, size))
    matrix[row, column] = matrix[column, row] = triangle / scale
    values, vectors = np.linalg.eigh(matrix)
    return ((vectors * np.maximum(values, 0.0)) @ vectors.T)[row, column] * scale


def _monomials(most: float) -> list[Exponents]:
    """All products of the z that count at most so much."""
    found: list[tuple[Exponents, float]] = [((), most)]
    for weight in WEIGHTS:
        found = [
            ((*powers, power), left - power * weight)
            for powers, left in found
            for power in range(int(left / weight + 1e-9) + 1)
        ]
    return [powers for powers, _ in found]


def _classes(most: float) -> list[list[Exponents]]:
    """The same by their signs when the signal changes sign and when time is reversed: squares mix none of these."""
    found: dict[tuple[int, int], list[Exponents]] = {}
    for monomial in _monomials(most) if most >= 0 else []:
        found.setdefault((sum(monomial) % 2, _under_reversal(monomial)), []).append(monomial)
    return list(found.values())


def _under_reversal(monomial: Exponents) -> int:
    return (-1) ** sum(monomial[::2])


def _times(one: Exponents, other: Exponents) -> Exponents:
    return tuple(a + b for a, b in zip(one, other, strict=True))
