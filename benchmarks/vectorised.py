"""The best NumPy version that we could write: shared draws, Gram sums, exact conditioning, a process per core.

It draws the gyro's noise alone, block by block so that a block stays in the cache; every group is solved from the same
sums, and the load cell's white noise is drawn as what it leaves in them. NumPy alone is imported here, so that a worker
starts quickly and has its own single-threaded BLAS.
"""

import multiprocessing
import os
from typing import NamedTuple

import numpy as np

BLOCK = 4000
"""Samples of a block: its features fit into the second-level cache."""
CASES = ("total", "load_cell", "cg", "imu")


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


def estimates(
    truth: Truth, trials: int, seed: int, dtype: str, maps: np.ndarray, generator: np.random.Generator | None = None
) -> np.ndarray:
    """Return the estimates of so many trials, (trials, cases, 6) [kg·m²]; ``maps``: Omega_R of the features."""
    generator = generator or np.random.Generator(np.random.SFC64(seed))
    cast = truth._replace(omega=truth.omega.astype(dtype), wrench=truth.wrench.astype(dtype))
    found = [sums(cast, generator, dtype) for _ in range(trials)]
    noisy = tuple(np.array(part) for part in zip(*found, strict=True))
    true = tuple(np.broadcast_to(part, (trials, *part.shape)) for part in sums(truth, None, "float64"))
    draw = {name: s * generator.standard_normal((trials, 3)) for name, s in truth.sigma.items() if "bias" in name}
    z = generator.standard_normal((trials, 6))
    both = np.concatenate([draw["F_bias"], draw["M_bias"]], axis=1)
    none = np.zeros((trials, 3))
    cases = [
        (noisy, draw["omega_bias"], both, z, draw["r_cg_bias"]),
        (true, none, both, z, none),
        (true, none, 0 * both, None, draw["r_cg_bias"]),
        (noisy, draw["omega_bias"], 0 * both, None, none),
    ]
    return np.stack([_solved(truth, maps, *case) for case in cases], axis=1)


def _solved(truth: Truth, maps: np.ndarray, case, gyro_bias, cell_bias, z, r_error) -> np.ndarray:
    """Solve one case of all trials; ``z``: standard normal numbers for the load cell's white noise, or None."""
    gram, right = case
    shift, r_cg = _shift(gyro_bias), truth.r_cg + r_error
    right = shift @ (right + gram[:, :, :1] * cell_bias[:, None])
    gram = shift @ gram @ shift.swapaxes(1, 2)
    products = np.einsum("kai,lbj->klabij", maps, maps).reshape(169, -1)
    of_axes = (gram.reshape(-1, 169) @ products).reshape(-1, 3, 3, 6, 6)
    right = np.einsum("kji,tkj->ti", maps, right[:, :, 3:] - np.cross(r_cg[:, None], right[:, :, :3]))
    if z is not None:
        right = right + (np.linalg.cholesky(_right_covariance(truth, of_axes, r_cg)) @ z[..., None])[..., 0]
    return np.linalg.solve(np.einsum("taaij->tij", of_axes), right[..., None])[..., 0]


def _right_covariance(truth: Truth, of_axes: np.ndarray, r_cg: np.ndarray) -> np.ndarray:
    """Covariances of what the white noise of force and moment adds to the right sides of the normal equations."""
    of_force = np.cross(np.eye(3), r_cg[:, None]).swapaxes(1, 2)  # of the moment about the CG: -r × F
    residual = (of_force * truth.sigma["F_precision"] ** 2) @ of_force.swapaxes(1, 2)
    residual = residual + np.diag(truth.sigma["M_precision"] ** 2)
    return np.einsum("tab,tabij->tij", residual, of_axes)


def _shift(b: np.ndarray) -> np.ndarray:
    """Matrices that take the features of omega to those of omega + b."""
    shift = np.tile(np.eye(13), (len(b), 1, 1))
    shift[:, 1:4, 0] = b
    for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), start=4):
        shift[:, row, 0] = b[:, i] * b[:, j]
        shift[:, row, 1 + j] += b[:, i]
        shift[:, row, 1 + i] += b[:, j]
    return shift


class Workers:
    """A process per core that holds the noise-free runs."""

    def __init__(self, truths: list[Truth], maps: np.ndarray, cores: int) -> None:
        """Start them; their BLAS has one thread each."""
        kept = {name: os.environ.get(name) for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")}
        os.environ.update(dict.fromkeys(kept, "1"))
        self.cores, self.runs = cores, len(truths)
        self.pool = multiprocessing.get_context("spawn").Pool(cores, _start, (truths, maps))
        self.campaign(2 * cores, "float64")
        for name, value in kept.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})

    def campaign(self, trials: int, dtype: str) -> list[np.ndarray]:
        """Return the estimates of every run, (trials, cases, 6)."""
        share = -(-trials // self.cores)
        jobs = [(run, share, worker, dtype) for run in range(self.runs) for worker in range(self.cores)]
        found = self.pool.starmap(_work, jobs, chunksize=1)
        return [np.concatenate(found[k : k + self.cores])[:trials] for k in range(0, len(found), self.cores)]


_HELD: list = []


def _start(truths: list[Truth], maps: np.ndarray) -> None:
    _HELD[:] = [truths, maps]


def _work(run: int, trials: int, worker: int, dtype: str) -> np.ndarray:
    truths, maps = _HELD
    return estimates(truths[run], trials, 1000 * run + worker, dtype, maps)
