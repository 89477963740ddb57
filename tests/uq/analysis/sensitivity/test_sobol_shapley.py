"""Sobol indices and Shapley effects against closed forms, SALib, and their own stated standard errors."""

from functools import cache
from itertools import combinations
from math import comb, prod

import jax.numpy as jnp
import numpy as np
import pytest
from SALib.analyze import sobol as salib_sobol
from SALib.sample import sobol as salib_sample

import uq.analysis.sensitivity.sobol_shapley
from tests.helpers.jcgm_distributions import MultivariateNormal
from uq.analysis.sensitivity.sobol_shapley import shapley, sobol
from uq.analysis.sensitivity.subsets import effects_of_costs, effects_of_swaps, walsh
from uq.report.tables.measurands import sensitivity_tables
from uq.sources.distributions import Normal, Rectangular, UShaped

# --- models with closed forms ---

ANGLE = Rectangular(-np.pi, np.pi)
ISHIGAMI = {"a": ANGLE, "b": ANGLE, "c": ANGLE}
A, B = 7.0, 0.1


def ishigami(x):
    return 50.0 + jnp.sin(x["a"]) + A * jnp.sin(x["b"]) ** 2 + B * x["c"] ** 4 * jnp.sin(x["a"])


def ishigami_closed():
    """Ishigami and Homma 1990: V_a, V_b and the interaction V_ac are all there is."""
    first_alone = (1 + B * np.pi**4 / 5) ** 2 / 2
    second_alone, interaction = A**2 / 8, B**2 * np.pi**8 * (1 / 18 - 1 / 50)
    closed = {
        "first": np.array([first_alone, second_alone, 0]),
        "total": np.array([first_alone + interaction, second_alone, interaction]),
        "shapley": np.array([first_alone + interaction / 2, second_alone, interaction / 2]),
    }
    return {kind: values / (first_alone + second_alone + interaction) for kind, values in closed.items()}


G = np.array([0.0, 1.0, 4.5, 9.0])
UNIT = {f"x{k}": Rectangular(0.0, 1.0) for k in range(len(G))}


def g_function(x):
    return prod((jnp.abs(4 * x[f"x{k}"] - 2) + a) / (1 + a) for k, a in enumerate(G))


def g_closed():
    """Sobol's g: the ANOVA term of a subset has the variance Π v_i, v_i = 1 / (3 (1 + a_i)²)."""
    v, d = 1 / (3 * (1 + G) ** 2), len(G)
    subsets = [u for size in range(1, d + 1) for u in combinations(range(d), size)]
    term = {u: np.prod(v[list(u)]) for u in subsets}
    whole = sum(term.values())

    def summed(k, weight):
        return sum(weight(u) * value for u, value in term.items() if k in u) / whole

    return {
        "first": np.array([summed(k, lambda u: len(u) == 1) for k in range(d)]),
        "total": np.array([summed(k, lambda u: 1) for k in range(d)]),
        "shapley": np.array([summed(k, lambda u: 1 / len(u)) for k in range(d)]),
    }


CORRELATION = {("x0", "x1"): 0.6, ("x1", "x2"): -0.4, ("x0", "x3"): 0.3}
SLOPES, SIGMAS = np.array([1.0, -2.0, 0.5, 1.5]), np.array([1.0, 0.7, 2.0, 0.0 + 1.2])
NORMALS = {f"x{k}": Normal(float(k), float(s)) for k, s in enumerate(SIGMAS)}


def linear(x):
    return sum(slope * x[f"x{k}"] for k, slope in enumerate(SLOPES))


def covariance(correlation, sigmas):
    matrix = np.eye(len(sigmas))
    for (first, second), value in correlation.items():
        i, j = int(first[1:]), int(second[1:])
        matrix[i, j] = matrix[j, i] = value
    return matrix * np.outer(sigmas, sigmas)


def gaussian_closed(slopes, sigma):
    """Owen and Prieur 2017, theorem 2: Y = βᵀX, X normal with covariance Σ; from conditional covariances."""
    d = len(slopes)

    def given(u):  # covariance of all, given X_u
        u = list(u)
        return sigma - sigma[:, u] @ np.linalg.solve(sigma[np.ix_(u, u)], sigma[u]) if u else sigma

    def effect(i):
        total = 0.0
        others = [k for k in range(d) if k != i]
        for size in range(d):
            for u in combinations(others, size):
                c = given(u)
                rest = [k for k in range(d) if k not in u]
                total += (c[i, rest] @ slopes[rest]) ** 2 / c[i, i] / comb(d - 1, size)
        return total / d

    variance = slopes @ sigma @ slopes
    rest = [[k for k in range(d) if k != i] for i in range(d)]
    return {
        "first": np.array([1 - slopes @ given([i]) @ slopes / variance for i in range(d)]),
        "total": np.array([slopes @ given(rest[i]) @ slopes / variance for i in range(d)]),
        "shapley": np.array([effect(i) for i in range(d)]) / variance,
    }


CLOSED = {
    "ishigami": (ishigami, ISHIGAMI, None, ishigami_closed()),
    "g": (g_function, UNIT, None, g_closed()),
    "gaussian": (linear, NORMALS, CORRELATION, gaussian_closed(SLOPES, covariance(CORRELATION, SIGMAS))),
}


def runs(name, **options):
    """Every way of computing the indices of a model, with its closed form."""
    model, inputs, correlation, closed = CLOSED[name]
    yield shapley(model, inputs, correlation=correlation, **options), closed
    if correlation is None:
        yield sobol(model, inputs, **options), closed


def walked(name, monkeypatch, **options):
    """Shapley effects from random permutations, as for more than ten inputs."""
    model, inputs, correlation, closed = CLOSED[name]
    monkeypatch.setattr(uq.analysis.sensitivity.sobol_shapley, "MOST_PLAYERS", 1)
    return shapley(model, inputs, correlation=correlation, **options), closed


def kinds(result):
    return {k: getattr(result, k) for k in ("first", "total", "shapley") if getattr(result, k) is not None}


# --- closed forms ---


POINTS = ["quasi-random", "random"]


CASES = [
    *((name, "quasi-random") for name in CLOSED),
    pytest.param("g", "random", marks=pytest.mark.slow),
    *(pytest.param(name, "random", marks=pytest.mark.study) for name in ("ishigami", "gaussian")),
]


@pytest.mark.parametrize(("name", "points"), CASES)
def test_indices_are_the_closed_form(name, points, monkeypatch):
    """55 comparisons at 4 standard errors, at 5 of eight replicates (Student's t): 0.4 and 3 % false alarms."""
    factor = 4 if points == "random" else 5
    options = {"trials": 4000, "points": points}
    for result, closed in [*runs(name, **options), walked(name, monkeypatch, **options)]:
        for kind, indices in kinds(result).items():
            error = np.abs(indices.value[:, 0] - closed[kind])
            assert (error <= factor * indices.standard_error[:, 0] + 1e-12).all(), (kind, error, indices)
            assert indices.standard_error.max() < 0.03
        assert np.abs(result.closure - 1) <= factor * result.closure_standard_error
        if result.shapley is not None:
            np.testing.assert_allclose(result.shapley.sum[0], 1, rtol=1e-12)


def test_two_correlated_normals_share_as_owen_and_prieur_say():
    """Their eq. 9 for d = 2: Sh_1 = β1²σ1²(1 - ρ²/2) + ρβ1β2σ1σ2 + β2²σ2²ρ²/2; ρ = 1 shares in halves what is one."""
    inputs = {"x0": Normal(0.0, 1.0), "x1": Normal(0.0, 2.0)}
    for rho in (-0.7, 0.5, 1.0):
        result = shapley(lambda x: x["x0"] + 3 * x["x1"], inputs, correlation={("x0", "x1"): rho}, trials=4000)
        first, second, shared = 1.0, 36.0, 6.0 * rho
        closed = (first * (1 - rho**2 / 2) + shared + second * rho**2 / 2) / (first + second + 2 * shared)
        assert abs(result.shapley.value[0, 0] - closed) <= 4 * result.shapley.standard_error[0, 0] + 1e-12


def test_the_oracle_of_correlated_normals_is_the_definition():
    """The theorem against Shapley's own formula over Var E[Y | X_u], computed by hand for two inputs."""
    sigma = np.array([[1.0, 0.8], [0.8, 4.0]])
    slopes = np.array([1.0, -2.0])
    variance = slopes @ sigma @ slopes
    alone = [(sigma[i] @ slopes) ** 2 / sigma[i, i] for i in (0, 1)]
    expected = [(alone[0] + variance - alone[1]) / 2 / variance, (alone[1] + variance - alone[0]) / 2 / variance]
    np.testing.assert_allclose(gaussian_closed(slopes, sigma)["shapley"], expected)


def test_more_than_ten_correlated_inputs():
    d = 11
    slopes, sigmas = np.linspace(1, 2, d), np.linspace(2, 0.5, d)
    correlation = {(f"x{k}", f"x{k + 1}"): 0.45 for k in range(0, d - 1)}
    inputs = {f"x{k}": Normal(0.0, float(s)) for k, s in enumerate(sigmas)}
    model = lambda x: sum(slopes[k] * x[f"x{k}"] for k in range(d))  # noqa: E731
    result = shapley(model, inputs, correlation=correlation, trials=4000)
    closed = gaussian_closed(slopes, covariance(correlation, sigmas))["shapley"]
    assert (result.first, result.total) == (None, None)
    assert (np.abs(result.shapley.value[:, 0] - closed) <= 4 * result.shapley.standard_error[:, 0]).all()
    assert result.shapley.standard_error.max() < 0.02


def test_salib_agrees():
    """On the g function and on a model with other distributions' names for SALib: its own sampling and estimators."""
    problem = {"num_vars": 4, "names": list(UNIT), "bounds": [[0, 1]] * 4}
    points = salib_sample.sample(problem, 2048, calc_second_order=False, seed=1)
    values = np.asarray(g_function(dict(zip(UNIT, points.T, strict=True))))
    theirs = salib_sobol.analyze(problem, values, calc_second_order=False, seed=1)
    ours = sobol(g_function, UNIT, trials=4000)
    for indices, name in ((ours.first, "S1"), (ours.total, "ST")):
        error = np.hypot(indices.standard_error[:, 0], theirs[f"{name}_conf"] / 1.96)
        assert (np.abs(indices.value[:, 0] - theirs[name]) <= 4 * error).all()


# --- several outputs, groups ---


def test_generalised_indices_are_shares_of_the_trace():
    """Two outputs that are linear in independent inputs: shares of Σ_j a_jk² σ_k², over both outputs."""
    matrix = np.array([[1.0, 2.0, 0.0], [0.5, 0.0, 3.0]])
    inputs = {"a": Normal(5.0, 1.0), "b": UShaped(-1.0, 1.0), "c": Rectangular(0.0, 1.0)}
    sigma = np.array([1.0, np.sqrt(1 / 2), np.sqrt(1 / 12)])
    result = shapley(lambda x: jnp.asarray(matrix) @ jnp.stack([x["a"], x["b"], x["c"]]), inputs, trials=4000)
    parts = matrix**2 * sigma**2
    for indices in kinds(result).values():
        assert (
            np.abs(indices.value - (parts / parts.sum(1, keepdims=True)).T) <= 4 * indices.standard_error + 1e-12
        ).all()
        whole = parts.sum(0) / parts.sum()
        assert (np.abs(indices.generalised - whole) <= 4 * indices.generalised_standard_error).all()
        np.testing.assert_allclose(
            indices.value[1, 1], 0, atol=1e-15
        )  # an input without effect: nought, but not left out
    assert (np.abs(result.variance - parts.sum(1)) <= 4 * result.variance_standard_error).all()


@pytest.mark.parametrize("function", [sobol, shapley])
def test_groups_are_players(function):
    """With b and c one player, Ishigami has b + c, and a with the interaction of both: Shapley in halves."""
    result = function(ishigami, ISHIGAMI, groups={"rest": ["b", "c"]}, trials=4000)
    alone = ishigami_closed()
    both = alone["total"][2]
    first = [alone["first"][0], alone["first"][1]]
    closed = {"first": first, "total": [first[0] + both, first[1] + both], "shapley": np.add(first, both / 2)}
    assert result.players == ("a", "rest")
    for kind, indices in kinds(result).items():
        assert (np.abs(indices.value[:, 0] - closed[kind]) <= 4 * indices.standard_error[:, 0]).all()


def test_an_input_may_be_an_array_of_correlated_values():
    inputs = {"pair": MultivariateNormal(np.zeros(2), np.array([[1.0, 0.5], [0.5, 1.0]])), "c": Normal(0.0, 1.0)}
    result = shapley(lambda x: x["pair"][0] + x["pair"][1] + x["c"], inputs, trials=4000)
    assert (np.abs(result.shapley.value[:, 0] - [0.75, 0.25]) <= 4 * result.shapley.standard_error[:, 0]).all()


# --- identities ---


def test_swaps_are_the_mean_over_all_pairs(generator):
    """The Walsh transform against the plain sum over every pair of outputs that differ by a swap."""
    y = generator.normal(size=(16, 3)) + 100
    players = [0b0001, 0b0110, 0b1000]
    costs = np.array([np.mean([(y[w] - y[w ^ s]) ** 2 / 2 for w in range(16)], axis=0) for s in range(16)])
    expected = effects_of_costs(players, 4) @ costs
    effects = effects_of_swaps(players, 4) @ (walsh(4) @ y) ** 2
    np.testing.assert_allclose(effects, expected, atol=1e-9)
    np.testing.assert_allclose(effects[6:9].sum(0), effects[9], atol=1e-9)  # Shapley effects share out the variance
    products = [  # of differences: Owen's estimator of the first order
        np.mean([(y[w] - y[w ^ p]) * (y[w ^ 15 ^ p] - y[w ^ 15]) / 2 for w in range(16)], axis=0) for p in players
    ]
    np.testing.assert_allclose(effects[:3], products, atol=1e-9)


@pytest.mark.slow
def test_neither_order_nor_an_idle_input_nor_the_mean_changes_an_index():
    straight = sobol(g_function, UNIT, trials=50)
    turned = sobol(g_function, dict(reversed(UNIT.items())), trials=50)
    np.testing.assert_allclose(turned.first.value[::-1], straight.first.value, atol=1e-12)
    near = shapley(g_function, UNIT, trials=50)
    drawn = shapley(g_function, UNIT, trials=50, points="random")
    more = shapley(g_function, {"idle": Normal(0.0, 1.0), **UNIT}, trials=50, points="random")
    np.testing.assert_allclose(more.shapley.value[1:], drawn.shapley.value, atol=1e-12)
    np.testing.assert_allclose(more.shapley.value[0], 0, atol=1e-15)
    far = shapley(lambda x: 1e6 + g_function(x), UNIT, trials=50)
    np.testing.assert_allclose(far.first.value, near.first.value, atol=1e-8)
    np.testing.assert_allclose(far.closure, near.closure, rtol=1e-8)


def test_a_table_shows_every_input_with_its_standard_error():
    result = shapley(ishigami, ISHIGAMI, trials=100)
    (table,) = sensitivity_tables(result, 0)
    head, rows = table.head, table.rows
    assert head == ["input", "first order", "total", "Shapley"]
    assert [row[0] for row in rows] == ["a", "b", "c", "sum"]
    assert all("±" in cell for row in rows[:3] for cell in row[1:])
    assert "closure" in repr(result)
    assert "closure" in result._repr_html_()
    assert rows[3][3] == "1.000"


def test_failed_trials_are_counted_and_left_out():
    result = shapley(lambda x: jnp.where(x["a"] > 3, jnp.nan, ishigami(x)), ISHIGAMI, trials=400)
    assert 0 < result.failed < 100
    assert np.isfinite(result.shapley.value).all()
    assert f"{result.failed} failed and are left out" in repr(result)


def test_a_constant_has_no_shares():
    result = sobol(lambda x: 0 * x["a"], {"a": Normal(0.0, 1.0)}, trials=10)
    assert np.isnan(result.first.value).all()
    assert "–" in repr(result)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"trials": 1}, "must be two or more"),
        ({"groups": {"g": ["z"]}}, "'z' is none of a, b"),
        ({"groups": {"g": ["a"], "h": ["a"]}}, "'a' is in 'g' and 'h'"),
        ({"correlation": {("a", "z"): 0.5}}, "'z' is none of a, b"),
        ({"correlation": {("a", "c"): 0.5}}, "'c' is not one"),
        ({"correlation": {("a", "b"): 1.5}}, "of a and b is 1.5"),
        ({"correlation": {("a", "b"): 1.0, ("a", "d"): 1.0, ("b", "d"): -1.0}}, "negative eigenvalue"),
    ],
)
def test_mistakes_are_named(options, message):
    normal = Normal(0.0, 1.0)
    inputs = {"a": normal, "b": normal, "c": Rectangular(0.0, 1.0), "d": normal}
    with pytest.raises(ValueError, match=message):
        shapley(lambda x: x["a"], inputs, **options)


# --- calibration of the standard errors ---


@cache
def covered(name, way, points, repeats, trials):
    """How often each closed form lies within two standard errors, by index."""
    hits = {}
    for seed in range(repeats):
        options = {"trials": trials, "seed": seed, "points": points}
        with pytest.MonkeyPatch.context() as patch:
            if way == "walks":
                estimated, closed = walked(name, patch, **options)
            else:
                estimated, closed = list(runs(name, **options))[way == "sobol"]
        for kind, indices in kinds(estimated).items():
            hit = np.abs(indices.value[:, 0] - closed[kind]) <= 2 * indices.standard_error[:, 0]
            hits.setdefault(kind, []).append(hit)
    return {kind: np.mean(hit, axis=0) for kind, hit in hits.items()}


WAYS = [(name, way) for name in CLOSED for way in ("shapley", "sobol", "walks") if (name, way) != ("gaussian", "sobol")]


@pytest.mark.slow
@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize(("name", "way"), [("ishigami", "sobol"), ("g", "shapley"), ("gaussian", "walks")])
def test_standard_errors_cover_the_closed_form(name, way, points):
    """Each way once; 50 repeats of 300 trials: a coverage of 95 % has a standard error of 3 %."""
    for kind, coverage in covered(name, way, points, 50, 300).items():
        assert (coverage >= 0.84).all(), (kind, coverage)
        assert 0.88 <= coverage.mean() <= 0.995, (kind, coverage)


@pytest.mark.study
@pytest.mark.parametrize("points", POINTS)
@pytest.mark.parametrize(("name", "way"), WAYS)
def test_standard_errors_cover_the_closed_form_in_90_to_99_per_cent(name, way, points):
    """400 repeats of 1,024 trials: a coverage of 95 % has a standard error of 1 %."""
    for kind, coverage in covered(name, way, points, 400, 1024).items():
        print(name, way, points, kind, coverage)
        assert ((coverage >= 0.90) & (coverage <= 0.99)).all(), (kind, coverage)


@pytest.mark.slow
def test_quasi_random_trials_know_more():
    """Of ten repeats of 2,048 trials the mean square error of all first orders is less than half that of random ones."""
    model, inputs, _, closed = CLOSED["g"]
    square = {
        points: np.mean(
            [(sobol(model, inputs, trials=2048, seed=s, points=points).first.value[:, 0] - closed["first"]) ** 2
             for s in range(10)],
            axis=0,
        ).sum()
        for points in POINTS
    }  # fmt: skip
    assert square["quasi-random"] < square["random"] / 2


def test_a_model_may_call_lapack():
    """Two devices of one processor would wait for each other for ever: a trial of 500 eigenproblems at a time."""
    inputs = {"a": Normal(1.0, 0.1), "b": Normal(0.3, 0.1)}
    result = sobol(lambda x: jnp.linalg.eigvalsh(jnp.diag(jnp.stack([x["a"], x["b"]]))), inputs, trials=500)
    np.testing.assert_allclose(result.first.value, [[0, 1], [1, 0]], atol=0.2)
