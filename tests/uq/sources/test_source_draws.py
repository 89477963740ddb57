"""Draws of declared sources: the distribution that the file names, samples from a file, correlations."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from tests.helpers.source_lab import experiment, simulated, source
from uq.monte_carlo.campaign.simulation import simulate
from uq.sources.draws import constant_coordinates, constants_at, draw_constants


def drawn_by_key(e, n=3000):
    draw = lambda index: draw_constants(e.sources, e.mixing, jax.random.key(1), index, jnp.dtype(float))  # noqa: E731
    return {name: np.asarray(values) for name, values in jax.jit(jax.vmap(draw))(jnp.arange(n)).items()}


def drawn_at_points(e, n=3000):
    points = jnp.asarray(np.random.default_rng(4).random((n, constant_coordinates(e.sources))))
    at = jax.jit(jax.vmap(lambda point: constants_at(e.sources, e.mixing, point)))
    return {name: np.asarray(values) for name, values in at(points).items()}


LAWS = [
    ({"sigma": ["2 N"] * 3}, stats.norm(0, 2)),
    ({"sigma": ["2 N"] * 3, "mean": ["5 N"] * 3}, stats.norm(5, 2)),
    ({"distribution": "rectangular", "half_width": ["2 N"] * 3}, stats.uniform(-2, 4)),
    ({"distribution": "rectangular", "sigma": ["2 N"] * 3}, stats.uniform(-np.sqrt(12), 2 * np.sqrt(12))),
    ({"distribution": "triangular", "half_width": ["2 N"] * 3}, stats.triang(0.5, -2, 4)),
    ({"distribution": "u_shaped", "half_width": ["2 N"] * 3}, stats.arcsine(-2, 4)),
    ({"distribution": "student_t", "scale": ["2 N"] * 3, "degrees_of_freedom": 4}, stats.t(4, 0, 2)),
    ({"datasheet": "±0.5 % of full scale, k = 2", "full_scale": ["800 N"] * 3}, stats.norm(0, 2)),
    ({"datasheet": ["accuracy ±2 N"] * 3}, stats.uniform(-2, 4)),
    ({"datasheet": "resolution 4 N"}, stats.uniform(-2, 4)),
]


@pytest.fixture(scope="module", params=[drawn_by_key, drawn_at_points])
def declared(request):
    """Sources of all laws in one experiment, and their draws: one compiled program."""
    e = experiment(*(source(f"s{k}", "F", "bias", **keys) for k, (keys, _) in enumerate(LAWS)))
    return e.sources, request.param(e)


@pytest.mark.parametrize("k", range(len(LAWS)))
def test_draws_have_the_declared_distribution(declared, k):
    """Sixty Kolmogorov-Smirnov tests at a level of 1e-4, with a fixed key."""
    sources, drawn = declared
    values, law = drawn[f"s{k}"], LAWS[k][1]
    for axis in range(3):
        assert stats.kstest(values[:, axis], law.cdf).pvalue > 1e-4
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 5 / np.sqrt(3000)
    assert float(sources[k].standard_deviation[0]) == pytest.approx(law.std())


def test_draws_from_a_file_of_samples(tmp_path):
    rows = np.random.default_rng(2).gamma(2.0, size=(40, 3)) * [1, 2, 3]
    (tmp_path / "cell.csv").write_text("# N\n" + "\n".join(", ".join(map(str, row)) for row in rows), "utf-8")
    (tmp_path / "one.txt").write_text("\n".join(map(str, rows[:, 0])), "utf-8")
    keys = {"distribution": "samples", "unit": "kN"}
    e = experiment(
        source("rows", "F", "bias", samples="cell.csv", **keys),
        source("one", "F", "bias", samples="one.txt", **keys),
        source("noise", "F", "precision", samples="cell.csv", **keys),
        source("scalar", "gravity", "bias", samples="one.txt", distribution="samples", unit="mm/s^2"),
        folder=tmp_path,
    )
    values = drawn_by_key(e, 400)
    where = np.abs(values["rows"][:, None] - 1e3 * rows[None]).sum(2)
    assert where.min(axis=1).max() < 1e-9  # whole rows
    assert len(set(where.argmin(axis=1))) > 35
    assert np.abs(values["one"][:, 2, None] - 1e3 * rows[None, :, 0]).min(axis=1).max() < 1e-9
    assert not np.allclose(values["one"][:, 0], values["one"][:, 1])
    assert np.abs(values["scalar"][:, None] - 1e-3 * rows[None, :, 0]).min(axis=1).max() < 1e-12
    noise = simulate(dataclasses.replace(e, sources=e.sources[2:3])).run.force - simulated(e)[0][:, :3]
    back = noise + 1e3 * rows.mean(0)  # noise is about the samples' mean
    assert np.abs(back[:, None] - 1e3 * rows[None]).sum(2).min(axis=1).max() < 1e-8


@pytest.mark.parametrize("drawn", [drawn_by_key, drawn_at_points])
def test_correlated_sources_have_the_declared_correlation(drawn):
    own = [[1, 0.5, -0.2], [0.5, 1, 0], [-0.2, 0, 1]]
    link = [[0.3, 0, 0], [0, 0.2, 0], [0.1, 0, -0.4]]
    e = experiment(
        source("a", "F", "bias", sigma=["1 N", "2 N", "3 N"], mean=["9 N"] * 3, correlation=own),
        source("b", "M", "scale", sigma=["1 %"] * 3),
        source("c", "gravity", "bias", sigma="1 m/s^2"),
        source("d", "omega", "delay", sigma="1 ms"),
        source("e", "wrench", "cross_talk", datasheet="±0.5 % FS", full_scale=["300 N"] * 3 + ["20 N*m"] * 3),
        source("free", "M", "bias", sigma=["1 N*m"] * 3),
        correlations=[{"sources": ["a", "b"], "coefficient": link}, {"sources": ["d", "c"], "coefficient": 1.0}],
    )
    n = 4000
    values = drawn(e, n)
    expected = np.eye(6)
    expected[:3, :3], expected[:3, 3:], expected[3:, :3] = own, link, np.transpose(link)
    joint = np.hstack([values["a"], values["b"]])
    # standard error (1 - ρ²)/√n; 36 comparisons at 5 of them: 2e-5 false alarms
    assert (np.abs(np.corrcoef(joint.T) - expected) < 5 * (1 - expected**2) / np.sqrt(n) + 1e-12).all()
    np.testing.assert_allclose(joint.std(0), [1, 2, 3, 0.01, 0.01, 0.01], rtol=5 / np.sqrt(2 * n))
    np.testing.assert_allclose(values["c"], 1e3 * values["d"], atol=1e-6)  # they go together wholly
    fewer = drawn(dataclasses.replace(e, sources=(e.sources[0], e.sources[5])), n)
    if drawn is drawn_by_key:  # of points the coordinates depend on which sources there are
        np.testing.assert_array_equal(fewer["free"], values["free"])
    assert (np.abs(np.corrcoef(fewer["a"].T) - own) < 5 / np.sqrt(n)).all()  # without b


def test_correlated_noise_has_the_declared_correlation():
    own = [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]
    e = experiment(
        source("F", "F", "precision", sigma=["1 N"] * 3, correlation=own),
        source("w", "omega", "precision", sigma=["1 rad/s"] * 3),
        correlations=[{"sources": ["F", "w"], "coefficient": 0.6}],
        duration="40 s",
    )
    run = simulate(e).run
    wrench, omega = simulated(e)
    n = len(omega)
    expected = np.eye(6)
    expected[:3, :3] = own
    expected[:3, 3:] = expected[3:, :3] = 0.6 * np.eye(3)
    found = np.corrcoef(np.hstack([run.force - wrench[:, :3], run.omega - omega]).T)
    assert (np.abs(found - expected) < 5 * (1 - expected**2) / np.sqrt(n) + 1e-12).all()  # 2e-5 false alarms
