"""The benchmarks' contenders do the same work: the NumPy version against the plain loop, the engine against both."""

import dataclasses

import jax
import numpy as np
import pytest

from benchmarks import reference, vectorised
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from uq.campaign.campaign import montecarlo
from uq.campaign.simulation import simulate


def truth_of(experiment):
    run = simulate(dataclasses.replace(experiment, sources=()), "T1").run
    sigma = {f"{s.target}_{s.kind}": np.asarray(s.sigma) for s in experiment.sources}
    wrench = np.ascontiguousarray(np.concatenate([run.force.T, run.moment.T]))
    return vectorised.Truth(np.ascontiguousarray(run.omega.T), wrench, 400.0, experiment.r_cg_from_q, sigma)


class Played:
    """A generator that plays given numbers, component first."""

    def __init__(self, numbers):
        self.numbers, self.at = numbers, 0

    def standard_normal(self, shape=None, dtype="float64", out=None):
        count = shape[1] if out is None else out.shape[1]
        part = self.numbers[:, self.at : self.at + count]
        self.at += count
        if out is None:
            return part.astype(dtype)
        out[:, : part.shape[1]] = part
        return out


@pytest.mark.parametrize(("dtype", "tolerance"), [("float64", 1e-12), ("float32", 2e-5)])
def test_the_numpy_versions_sums_are_those_of_the_loops_rows(brief, generator, dtype, tolerance):
    truth = truth_of(brief)
    noise = generator.normal(size=truth.omega.shape)
    cast = truth._replace(omega=truth.omega.astype(dtype), wrench=truth.wrench.astype(dtype))
    gram, right = vectorised.sums(cast, Played(noise), dtype)
    omega = (truth.omega + truth.sigma["omega_precision"][:, None] * noise).T
    rows = reference.rows(omega[1:-1], (omega[2:] - omega[:-2]) * 200)
    maps = OMEGA_R_OF_FEATURES
    of_sums = np.einsum("kji,lje,kl->ie", maps, maps, gram)
    np.testing.assert_allclose(of_sums, rows.T @ rows, atol=tolerance * np.abs(of_sums).max())
    of_sums = np.einsum("kji,kj->i", maps, right[:, 3:])
    expected = rows.T @ truth.wrench[3:, 1:-1].T.ravel()
    np.testing.assert_allclose(of_sums, expected, atol=tolerance * np.abs(expected).max())


def ratios(experiment, trials, dtype):
    """3σ of every group and component: of the engine over the NumPy version's; and mean errors in standard errors."""
    found = vectorised.estimates(truth_of(experiment), trials, 5, dtype, OMEGA_R_OF_FEATURES) - experiment.inertia
    result = montecarlo(experiment, trials=trials, trajectories="T1", estimators="central", dtype=dtype)
    groups = [result["T1", "central"].groups[name] for name in vectorised.CASES]
    spread, other = np.stack([of.three_sigma for of in groups]), 3 * found.std(0, ddof=1)
    means = np.stack([of.mean_error for of in groups]) - found.mean(0)
    return spread / other, means / np.hypot(spread, other) * 3 * np.sqrt(trials)


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.study)])
def test_the_engine_agrees_with_the_numpy_version(brief, dtype):
    trials = 1000
    ratio, means = ratios(brief, trials, dtype)
    # 24 of each: 5 standard errors, 3e-5 false alarms
    np.testing.assert_allclose(ratio, 1, atol=5 / np.sqrt(trials))
    assert np.abs(means).max() < 5


@pytest.mark.study
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_three_sigma_of_the_preset_within_one_per_cent(preset, dtype):
    ratio, means = ratios(preset, 40_000, dtype)
    print(
        dtype, "3σ engine / NumPy - 1, per cent:", np.round(100 * (ratio - 1), 2).tolist(), np.round(means, 1).tolist()
    )
    total = ratio[0]  # standard error of each ratio 0.5 %: the mean over six components 0.2 %
    assert abs(total.mean() - 1) < 0.01
    assert np.abs(ratio - 1).max() < 0.02
    assert len(jax.devices()) == 2
