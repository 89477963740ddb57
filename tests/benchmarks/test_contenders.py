"""The benchmarks' contenders do the same work: the NumPy versions against the plain loop, the engines against both."""

import jax
import numpy as np
import pytest

from benchmarks import reference, sums_in_numpy, vectorised
from benchmarks.contenders import engines, trials_of, truth_of
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from uq.sources.draws import constant_key, draw_constants, stream_number
from uq.sources.random_normals import normals_of_keys


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
    truth = truth_of(brief, "T1")
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


def test_the_solution_of_sums_is_that_of_the_loops_rows(brief, generator):
    """One trial with offsets of every sensor, its normal equations solved row by row."""
    truth = truth_of(brief, "T1")
    gyro, cell, r_error = (generator.normal(scale=s, size=n) for s, n in ((0.01, 3), (0.5, 6), (1e-3, 3)))
    true = (x[None] for x in vectorised.sums(truth, None, "float64"))
    solved = vectorised.solved(*vectorised.mapped(*true, gyro[None]), cell[None], (truth.r_cg + r_error)[None])
    rows = reference.rows((truth.omega.T + gyro)[1:-1], (truth.omega.T[2:] - truth.omega.T[:-2]) * 200)
    force, moment = np.split((truth.wrench + cell[:, None])[:, 1:-1].T, 2, axis=1)
    expected = np.linalg.lstsq(rows, (moment - np.cross(truth.r_cg + r_error, force)).ravel())[0]
    np.testing.assert_allclose(solved[0], expected, atol=1e-10 * brief.inertia.max())


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "dtype"), [("samples", "float32"), ("sums", "float64")])
def test_the_engines_agree_with_the_numpy_version(brief, generator, engine, dtype):
    """3σ and mean of every group and component: 48 figures in all at 5 standard errors, 3e-5 false alarms."""
    trials = 1000
    expected = vectorised.estimates(truth_of(brief, "T1"), trials, generator, dtype)
    (result,) = trials_of(engines(brief, engine, dtype, ["T1"]), trials)
    estimated = result[:, 0]
    spread, other = estimated.std(0, ddof=1), expected.std(0, ddof=1)
    np.testing.assert_allclose(spread / other, 1, atol=5 / np.sqrt(trials))
    means = (estimated.mean(0) - expected.mean(0)) / np.hypot(spread, other) * np.sqrt(trials)
    assert np.abs(means).max() < 5


@pytest.mark.slow
def test_sums_in_numpy_give_the_engines_estimates_from_the_same_numbers(brief):
    (engine,), trials, key = engines(brief, "sums", trajectories=["T1"]), 50, jax.random.key(0)
    indices = np.arange(trials)

    def normals(name, size):
        keys = jax.vmap(lambda index: constant_key(key, stream_number(name), index))(indices)
        return np.asarray(normals_of_keys(keys, size)).T

    constants = jax.jit(jax.vmap(lambda index: draw_constants(engine.sources, (), key, index, float)))(indices)
    draws = sums_in_numpy.Draws(
        jax.tree.map(np.asarray, constants),
        normals(engine.gyro.names[0], engine.gyro.roots.shape[-1]),
        *([normals(name, 6) for name in names] for names in (engine.cell.names, engine.crossed.names)),
    )
    expected = trials_of([engine], trials)[0][:, 0]
    estimated = sums_in_numpy.estimates(sums_in_numpy.on_host(engine), draws)
    np.testing.assert_allclose(estimated, expected, atol=1e-12 * brief.inertia.max())


@pytest.mark.study
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_three_sigma_of_the_preset_within_one_per_cent(preset, generator, dtype):
    """40,000 trials of the NumPy version against 400,000 on sums: a standard error of each ratio is 0.4 %."""
    expected = vectorised.estimates(truth_of(preset, "T1"), 40_000, generator, dtype)
    (result,) = trials_of(engines(preset, "sums", trajectories=["T1"]), 400_000)
    ratio = expected.std(0, ddof=1) / result[:, 0].std(0, ddof=1)
    print(dtype, "3σ NumPy / sums - 1, per cent:", np.round(100 * (ratio - 1), 2).tolist())
    assert abs(ratio[0].mean() - 1) < 0.01
    assert np.abs(ratio - 1).max() < 0.02
