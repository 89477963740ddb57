"""The reference: the paper's campaign as it describes itself, a plain NumPy loop.

Each group has its own trials, with errors from its own sources only; a trial draws its samples, differentiates omega by
central differences, stacks the rows of Omega_R and solves the normal equations (10).
"""

import numpy as np

GROUPS = ("total", "load_cell", "cg", "imu")


def rows(omega: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Stack Omega_R of all samples: omega and alpha (n, 3) to (3n, 6)."""
    w1, w2, w3 = omega.T
    a1, a2, a3 = alpha.T
    stacked = np.empty((len(omega), 3, 6))
    stacked[:, 0] = np.stack([a1, a2 - w1 * w3, a3 + w1 * w2, -w2 * w3, w2**2 - w3**2, w2 * w3], axis=1)
    stacked[:, 1] = np.stack([w1 * w3, a1 + w2 * w3, w3**2 - w1**2, a2, a3 - w1 * w2, -w1 * w3], axis=1)
    stacked[:, 2] = np.stack([-w1 * w2, w1**2 - w2**2, a1 - w2 * w3, w1 * w2, a2 + w1 * w3, a3], axis=1)
    return stacked.reshape(-1, 6)


def campaign(
    truth: dict[str, np.ndarray], sources, rate: float, r_cg: np.ndarray, trials: int, seed: int = 0
) -> dict[str, np.ndarray]:
    """Return the estimates of each group, (trials, 6) [kg·m²].

    Args:
        truth: true ``omega``, ``F``, ``M`` of the trajectory, each (n, 3).
        sources: the error sources, with ``target``, ``kind``, ``sigma`` and ``group``.
        rate: sample rate [Hz].
        r_cg: true centre of gravity from Q [m].
        trials: trials of each group.
        seed: seed of the generator.
    """
    generator = np.random.default_rng(seed)
    estimates = {}
    for group in GROUPS:
        active = [source for source in sources if group in ("total", source.group)]
        estimates[group] = np.array([_trial(generator, truth, active, rate, r_cg) for _ in range(trials)])
    return estimates


def _trial(generator, truth, sources, rate, r_cg) -> np.ndarray:
    signals = {**truth, "r_cg": r_cg}
    for source in sources:
        shape = signals[source.target].shape if source.kind == "precision" else (3,)
        error = np.asarray(source.sigma) * generator.standard_normal(shape)
        signals[source.target] = signals[source.target] + error
    omega = signals["omega"]
    alpha = (omega[2:] - omega[:-2]) * (rate / 2)
    regressor = rows(omega[1:-1], alpha)
    moment = (signals["M"] - np.cross(signals["r_cg"], signals["F"]))[1:-1].reshape(-1)
    return np.linalg.solve(regressor.T @ regressor, regressor.T @ moment)
