"""Generalised least squares: against dense algebra and theory; its gain, and intervals that hold."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy
from scipy.linalg import toeplitz

from identify.identification import identify
from identify.least_squares.generalised_least_squares import fitted
from identify.least_squares.residual_spectrum import Lines, spectrum
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, features
from identify.signals.run import Run
from tests.helpers import weak_lab as lab

MIXING = np.array([[1.0, 0.6, 0.0], [0.0, 1.0, 0.4], [0.3, 0.0, 0.5]])
MEMORY = 0.97
BODY = np.array([0.30, 0.01, -0.02, 0.25, 0.01, 0.28])
"""Well inside what bodies can have [kg·m²]."""


def rows_of(motion):
    _, omega, alpha = motion
    phi = np.asarray(features(jnp.asarray(omega.T), jnp.asarray(alpha.T)))
    return np.einsum("kji,kn->nji", OMEGA_R_OF_FEATURES, phi)


def test_the_transform_keeps_the_regression(generator):
    """Orthonormal: each segment's lines have the samples' sums of products, and a constant is in its first line."""
    lines = Lines.of([slice(0, 30), slice(30, 47)], rate=10.0)
    signal = generator.normal(size=(47, 2))
    np.testing.assert_allclose(lines.transform(signal).T @ lines.transform(signal), signal.T @ signal, rtol=1e-12)
    np.testing.assert_allclose(lines.transform(np.ones(47)), lines.constant, atol=1e-12)
    assert (np.diff(lines.frequency) >= 0).all()
    assert lines.frequency[-1] < 5.0


def test_white_noise_of_known_covariance_is_gauss_markovs(generator):
    """Weights from a million lines of the same noise are the covariance itself, to 1 %: 14 standard errors of it."""
    rows = rows_of(lab.swing(4.0))
    covariance = MIXING @ MIXING.T
    values = rows @ lab.ROD + generator.normal(size=(400, 3)) @ MIXING.T
    lines = Lines.of([slice(0, 400)], lab.RATE)
    x, y = lines.transform(rows), lines.transform(values)
    fit = fitted(x, y, 400, 1)
    weighed = np.linalg.solve(covariance, rows).reshape(-1, 6)  # the textbook's estimate, of a known covariance
    spread = np.linalg.inv(weighed.T @ rows.reshape(-1, 6))
    sigma = np.sqrt(np.diag(spread))
    assert np.abs((fit.value - spread @ weighed.T @ values.ravel()) / sigma).max() < 1.0
    np.testing.assert_allclose(np.sqrt(np.diag(fit.inverse)), sigma, rtol=0.25)


def test_what_is_stated_of_an_unknown_is_a_covariance_of_the_errors(generator):
    """Dense Gauss–Markov with ``S + L Lᵀ``, ``S`` the fit's: an unknown of unit variance is an error along its column."""
    rows, lever = rows_of(lab.swing(1.0)), generator.normal(size=(100, 3, 2))
    values = rows @ BODY + 0.1 * generator.normal(size=(100, 3)) + lever @ [0.5, -1.0]
    lines = Lines.of([slice(0, 100)], lab.RATE)
    x, along, y = (lines.transform(signal) for signal in (rows, lever, values))
    fit = fitted(np.concatenate([x, along], axis=2), y, 80, 1, prior=np.array([0, 0, 0, 0, 0, 0, 1.0, 1.0]))
    along, x = along[:80].reshape(-1, 2), x[:80].reshape(-1, 6)
    dense = scipy.linalg.block_diag(*np.linalg.inv(fit.weights)) + along @ along.T
    covariance = np.linalg.inv(x.T @ np.linalg.solve(dense, x))
    np.testing.assert_allclose(fit.inverse[:6, :6], covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(fit.value[:6], covariance @ x.T @ np.linalg.solve(dense, y[:80].ravel()), rtol=1e-6)


def test_coloured_noise_across_axes_reaches_the_dense_bound():
    """Dense Gauss–Markov knows the covariance of all 1,200 values; ours learns it. 120 runs: the variance's standard
    error is 13 %; ours may not exceed the dense one by more than 45 %, and ordinary least squares must."""
    motion = lab.swing(4.0)
    rows, n = rows_of(motion), 400
    lines, rng = Lines.of([slice(0, n)], lab.RATE), np.random.default_rng(5)
    dense = np.kron(toeplitz(MEMORY ** np.arange(n)), MIXING @ MIXING.T)
    flat = np.concatenate([rows, np.tile(np.eye(3), (n, 1, 1))], axis=2).reshape(-1, 9)
    bound = np.diag(np.linalg.inv(flat.T @ np.linalg.solve(dense, flat)))[:6]
    columns = np.concatenate([lines.transform(rows), lines.constant[:, None, None] * np.eye(3)], axis=2)
    ours, plain = [], []
    for _ in range(120):
        noise = lines.transform(lab.coloured(rng, n, MEMORY) @ MIXING.T)
        ours.append(fitted(columns, noise, n, 1).value[:6])
        plain.append(np.linalg.lstsq(columns.reshape(-1, 9), noise.ravel(), rcond=None)[0][:6])
    efficiency = np.var(ours, axis=0) / bound
    assert efficiency.max() < 1.45
    assert efficiency.mean() < 1.2
    assert (np.var(plain, axis=0) / bound).mean() > 1.3


def test_the_spectrum_is_the_noises(generator):
    """White noise of 4,000 lines: each window's variance within 5 standard errors, of 9 lines at least."""
    lines = Lines.of([slice(0, 4000)], 100.0)
    noise = lines.transform(generator.normal(size=(4000, 3)) @ MIXING.T)
    found = spectrum(noise, np.ones((4000, 3)), 1)
    values, half = found.values, 84  # the next whole number from 2 * 500^0.6
    assert found.windows(slice(500, 501)) == ([500 - half], [500 + half + 1])
    np.testing.assert_allclose(values[1000:].mean(axis=0), MIXING @ MIXING.T, atol=0.1)
    assert np.abs(np.einsum("maa->ma", values[1:]) / np.diag(MIXING @ MIXING.T) - 1).max() < 5 * np.sqrt(2 / 9)


@pytest.mark.parametrize("estimator", [lab.SMOOTH, lab.LOWPASSED])
def test_without_noise_it_is_exact_and_finds_the_offset(estimator, unjudged):
    run = lab.run(lab.ROD, lab.swing(10.0), np.random.default_rng(0), level=0.0)
    plain = identify(run, r_cg=lab.R_CG, estimator=estimator)
    ours = identify(run, r_cg=lab.R_CG, estimator=estimator, method="gls")
    # the central difference's gain, 0.2 % here, is stated to a fifth of it: lines count otherwise than samples
    np.testing.assert_allclose(ours.inertia - ours.bias, lab.ROD, atol=4e-4)
    np.testing.assert_allclose(ours.runs[0].offsets.moment, [0.3, -0.2, 0.1], atol=1e-3)
    np.testing.assert_allclose(ours.inertia, plain.inertia, atol=2e-3 * lab.ROD.max())


def test_a_gap_is_not_reached_across(unjudged):
    """Two segments with one offset: the answer stays within its uncertainty of the whole run's."""
    run = lab.run(lab.ROD, lab.swing(30.0), np.random.default_rng(3), memory=MEMORY, mixing=MIXING)
    keep = (run.t < 12) | (run.t > 14)
    cut = Run.from_channels(run.t, run.force, run.moment, run.t[keep], run.omega[keep])
    whole, gapped = (identify(r, r_cg=lab.R_CG, estimator=lab.SMOOTH, method="gls") for r in (run, cut))
    assert (np.abs(whole.inertia - gapped.inertia) < 2 * whole.standard_uncertainty).all()
    assert (gapped.standard_uncertainty < 1.4 * whole.standard_uncertainty).all()


@pytest.mark.parametrize(
    ("estimator", "runs", "least_gain"),
    [
        (lab.SMOOTH, 10, 0.95),
        pytest.param(lab.SMOOTH, 30, 0.85, marks=pytest.mark.slow),
        pytest.param(lab.LOWPASSED, 30, 0.85, marks=pytest.mark.study),
    ],
)
def test_its_intervals_hold_and_are_shorter(estimator, runs, least_gain, unjudged):
    """Strongly coloured noise across axes, so many runs x 6: three binomial standard errors, of fully correlated ones."""
    rng, motion = np.random.default_rng(11), lab.swing(20.0)
    held, ours, plain = [], [], []
    for _ in range(runs):
        run = lab.run(BODY, motion, rng, memory=0.99, mixing=MIXING)
        result = identify(run, r_cg=lab.R_CG, estimator=estimator, method="gls")
        held.append(lab.covered(result, BODY))
        ours.append(result.inertia - BODY)
        plain.append(identify(run, r_cg=lab.R_CG, estimator=estimator).inertia - BODY)
    assert np.mean(held) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / runs)
    assert np.mean(np.var(ours, axis=0) / np.var(plain, axis=0)) < least_gain


def test_an_unknown_method_is_refused():
    run = lab.run(lab.ROD, lab.swing(4.0), np.random.default_rng(0))
    with pytest.raises((ValueError, TypeError), match="method"):
        identify(run, r_cg=lab.R_CG, method="best")


STUDY = [(2, 0, "smooth"), (2, 0.9, "smooth"), (4, 0, "smooth"), (4, 0.98, "smooth"), (4, 0, "lowpassed"),
         (4, 0.98, "lowpassed"), (20, 0, "smooth"), (20, 0.998, "smooth")]  # fmt: skip


@pytest.mark.study
@pytest.mark.parametrize(("seconds", "memory", "name"), STUDY)
def test_coverage_over_many_runs(seconds, memory, name):
    """300 runs x 6: standard error 1.3 % of a component, between 0.5 and 1.3 % of all together."""
    rng, motion = np.random.default_rng(23), lab.swing(seconds)
    held = {"source": [], "gls": []}
    error = {"source": [], "gls": []}
    spec = {"smooth": lab.SMOOTH, "lowpassed": lab.LOWPASSED}[name]
    for _ in range(300):
        run = lab.run(BODY, motion, rng, memory=memory, mixing=MIXING)
        for method in held:
            result = identify(run, r_cg=lab.R_CG, estimator=spec, method=method)
            held[method].append(lab.covered(result, BODY))
            error[method].append(result.inertia - BODY)
    shares = {method: float(np.mean(result)) for method, result in held.items()}
    gain = np.sqrt(np.mean(np.var(error["gls"], axis=0) / np.var(error["source"], axis=0)))
    print(f"\n{seconds:g} s, memory {memory:g}, {name}: " + ", ".join(f"{m} {s:.3f}" for m, s in shares.items())
          + f"; gls/source dispersion {gain:.2f}")  # fmt: skip
    assert min(shares.values()) > 0.92
