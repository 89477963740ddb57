"""The best NumPy version of trials by samples that we could write: shared draws, Gram sums, exact conditioning.

It draws the gyro's noise alone, block by block so that a block stays in the cache; every group is solved from the same
sums, and the load cell's white noise is drawn as what it leaves in them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES

BLOCK = 4000
"""Samples of a block: its features fit into the second-level cache."""
CASES = ("total", "load_cell", "cg", "imu")
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Products of components, as features and pairs of axes have them."""
LOWER = np.tril_indices(6)
FULL = np.zeros((6, 6), int)
"""Places in the lower triangle, row by row, of a symmetric matrix's numbers."""
FULL[LOWER] = FULL.T[LOWER] = np.arange(21)
RIGHT = OMEGA_R_OF_FEATURES[4:].reshape(27, 6)
"""Omega_R of the features that it holds: products of omega, and alpha."""


def _by_axes() -> np.ndarray:
    """Return the matrix from these features' Gram matrix to ``Σ Ω_aᵀ Ω_b`` of each pair of axes, both ways."""
    rows = OMEGA_R_OF_FEATURES[4:]
    products = np.einsum("kai,lbj->klabij", rows, rows)
    both = [products[:, :, a, b] + (a != b) * products[:, :, b, a] for a, b in PAIRS]
    return np.stack(both, axis=2)[..., *LOWER].reshape(81, 126)


BY_AXES = _by_axes()


class Truth(NamedTuple):
    """The noise-free run."""

    omega: np.ndarray
    """(3, n) [rad/s]."""
    wrench: np.ndarray
    """(6, n), force before moment [N, N·m]."""
    rate: float
    """[Hz]."""
    r_cg: np.ndarray
    """[m]."""
    sigma: dict[str, np.ndarray]
    """Of each source, by ``target_kind``."""


def sums(truth: Truth, generator: np.random.Generator | None, dtype: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the features' Gram matrix (13, 13) and their sums with the wrench (13, 6), in float64.

    ``truth`` holds its signals in this type.
    """
    n = truth.omega.shape[1]
    wide, phi = np.empty((3, BLOCK + 2), dtype), np.empty((13, BLOCK), dtype)
    scale = truth.sigma["omega_precision"].astype(dtype)[:, None]
    gram, right = np.zeros((13, 13)), np.zeros((13, 6))
    noise, before = np.zeros((3, BLOCK), dtype), np.zeros((3, 2), dtype)
    if generator is not None:
        before = generator.standard_normal((3, 2), dtype=dtype) * scale
    for start in range(1, n - 1, BLOCK):
        m = min(BLOCK, n - 1 - start)
        if generator is not None:
            generator.standard_normal(dtype=dtype, out=noise)
            noise *= scale
        wide[:, :2] = before
        wide[:, 2:] = noise
        before = noise[:, -2:].copy()
        wide[:, : m + 2] += truth.omega[:, start - 1 : start + m + 1]
        fill(phi, wide, truth.rate)
        some = phi[:, :m]
        gram += some @ some.T
        right += some @ truth.wrench[:, start : start + m].T
    return gram, right


def fill(phi: np.ndarray, wide: np.ndarray, rate: float) -> None:
    """Write the thirteen features of a block, with central differences, into ``phi``."""
    inner = wide[:, 1:-1]
    phi[0] = 1
    phi[1:4] = inner
    np.multiply(inner, inner, out=phi[4:7])
    np.multiply(inner[:1], inner[1:], out=phi[7:9])
    np.multiply(inner[1], inner[2], out=phi[9])
    np.subtract(wide[:, 2:], wide[:, :-2], out=phi[10:13])
    phi[10:13] *= phi.dtype.type(rate / 2)


def estimates(truth: Truth, trials: int, generator: np.random.Generator, dtype: str) -> np.ndarray:
    """Return the estimates of so many trials, (trials, cases, 6) [kg·m²]."""
    cast = truth._replace(omega=truth.omega.astype(dtype), wrench=truth.wrench.astype(dtype))
    drawn = [sums(cast, generator, dtype) for _ in range(trials)]
    gram, right = map(np.stack, zip(*drawn, strict=True))
    true = [x[None] for x in sums(truth, None, "float64")]
    bias = {name: s * generator.standard_normal((trials, 3)) for name, s in truth.sigma.items() if "bias" in name}
    both, none = np.concatenate([bias["F_bias"], bias["M_bias"]], axis=1), np.zeros((1, 6))
    white = np.concatenate([truth.sigma["F_precision"], truth.sigma["M_precision"]]) ** 2
    noise = [(np.diag(white), generator.standard_normal((trials, 6)))]
    noisy, r_cg = mapped(gram, right, bias["omega_bias"]), truth.r_cg[None]
    cases = (
        solved(*noisy, both, r_cg + bias["r_cg_bias"], noise),
        solved(*true, both, r_cg, noise),
        solved(*true, none, r_cg + bias["r_cg_bias"]),
        solved(*noisy, none, r_cg),
    )
    return np.stack(cases, axis=1)


def mapped(gram: np.ndarray, right: np.ndarray, bias: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sums of omega + bias, trial by trial, from those of omega."""
    shift = np.tile(np.eye(13), (len(bias), 1, 1))
    shift[:, 1:4, 0] = bias
    for row, (i, j) in enumerate(PAIRS, start=4):
        shift[:, row, 0] = bias[:, i] * bias[:, j]
        shift[:, row, 1 + j] += bias[:, i]
        shift[:, row, 1 + i] += bias[:, j]
    return shift @ gram @ shift.swapaxes(1, 2), shift @ right


def solved(
    gram: np.ndarray,
    right: np.ndarray,
    cell_bias: np.ndarray,
    r_cg: np.ndarray,
    noise: Sequence[tuple[np.ndarray, np.ndarray]] = (),
) -> np.ndarray:
    """Return the estimates of one case, (trials, 6), from its sums; what is the same in all trials has length 1.

    ``noise``: of the load cell, covariances of one sample's (6, 6) and standard normal numbers (trials, 6).
    """
    right = right + gram[:, :, :1] * cell_bias[:, None]
    right = right[:, 4:, 3:] - np.cross(r_cg[:, None], right[:, 4:, :3])
    right = right.reshape(-1, 27) @ RIGHT
    by_axes = (gram[:, 4:, 4:].reshape(-1, 81) @ BY_AXES).reshape(-1, 6, 21)
    crossed = np.cross(np.eye(3), r_cg[:, None])
    to_moment = np.concatenate([crossed, np.broadcast_to(np.eye(3), crossed.shape)], axis=1)
    for white, z in noise:
        residual = to_moment.swapaxes(1, 2) @ white @ to_moment  # of M - r × F
        covariance = np.einsum("tp,tpk->tk", residual[:, *np.transpose(PAIRS)], by_axes)[:, FULL]
        right = right + np.einsum("tij,tj->ti", triangular_root(covariance), z)
    normal = by_axes[:, :3].sum(axis=1)[:, FULL]
    if len(normal) == 1:
        return np.linalg.solve(normal[0], right.T).T
    return np.linalg.solve(normal, right[..., None])[..., 0]


def triangular_root(matrix: np.ndarray) -> np.ndarray:
    """Return Cholesky's L of matrices (trials, 6, 6), also of singular ones, which ``np.linalg.cholesky`` refuses."""
    root = np.zeros_like(matrix)
    for j in range(6):
        column = matrix[:, j:, j] - (root[:, j:, :j] @ root[:, j, :j, None])[..., 0]
        pivot = np.maximum(column[:, :1], 0)
        root[:, j:, j] = np.divide(column, np.sqrt(pivot), out=np.zeros_like(column), where=pivot > 0)
    return root
