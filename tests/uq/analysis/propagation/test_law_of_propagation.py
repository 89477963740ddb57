"""The law of propagation: closed forms of curved models, the GUM's own worked examples, degrees of freedom."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import t as student

from tests.helpers.jcgm_distributions import MultivariateNormal
from uq.analysis.propagation.law_of_propagation import propagate
from uq.sources.distributions import Empirical, Rectangular, StudentT


class Given(NamedTuple):
    mean: np.ndarray
    standard_deviation: np.ndarray
    degrees_of_freedom: float = np.inf


class Joint(NamedTuple):
    mean: np.ndarray
    covariance: np.ndarray
    degrees_of_freedom: float = np.inf

    @property
    def standard_deviation(self):
        return np.sqrt(np.diag(self.covariance))


def scalar(mean, sigma, freedom=np.inf):
    return Given(np.array(float(mean)), np.array(float(sigma)), freedom)


def test_a_linear_model_is_exact():
    """JCGM 101 9.2: Y = X1 + X2 + X3 + X4."""
    law = propagate(lambda x: sum(x.values()), {f"x{k}": scalar(0, 1) for k in range(4)})
    assert law.value.shape == ()
    assert law.value == 0
    assert law.standard_uncertainty == pytest.approx(2.0, rel=1e-12)
    assert law.coverage_interval(0.95)[1] == pytest.approx(3.92, abs=0.005)  # table 2 of JCGM 101
    assert law.second_order_covariance == pytest.approx(4.0, rel=1e-12)


def test_a_polynomial_of_normal_inputs_has_its_exact_moments():
    """For y = a x² + b x z + c z + d x³ the moments follow from Gaussian moments; d enters to the GUM's order alone."""
    a, b, c, d, s, u = 1.3, -0.7, 0.4, 0.05, 0.3, 0.2

    def model(i):
        return a * i["x"] ** 2 + b * i["x"] * i["z"] + c * i["z"] + d * i["x"] ** 3

    law = propagate(model, {"z": scalar(0, u), "x": scalar(0, s)})
    assert law.second_order_mean == pytest.approx(a * s**2, rel=1e-12)
    assert law.covariance[0, 0] == pytest.approx(c**2 * u**2, rel=1e-12)
    assert law.second_order_covariance[0, 0] == pytest.approx(c**2 * u**2 + 2 * a**2 * s**4 + b**2 * s**2 * u**2)
    # about x = 1 the cubic has a slope: ∂f ∂³f s⁴ = (2a + 3d)(6d) s⁴, and ½ f''² s⁴ = ½ (2a + 6d)² s⁴
    law = propagate(lambda i: a * i["x"] ** 2 + d * i["x"] ** 3, {"x": scalar(1, s)})
    slope, curvature, third = 2 * a + 3 * d, 2 * a + 6 * d, 6 * d
    expected = slope**2 * s**2 + (curvature**2 / 2 + slope * third) * s**4
    assert law.second_order_covariance[0, 0] == pytest.approx(expected, rel=1e-12)


def test_mass_calibration_needs_the_higher_order():
    """JCGM 101 9.3, table 7: 0.0539 mg of first order, 0.0750 mg with the higher-order terms."""

    def model(i):
        air = (i["air"] - 1.2) * (1 / i["weight"] - 1 / i["reference"])
        return (i["conventional"] + i["added"]) * (1 + air) - 100_000.0

    inputs = {
        "conventional": scalar(100_000, 0.050),
        "added": scalar(1.234, 0.020),
        "air": scalar(1.20, 0.10 / np.sqrt(3)),
        "weight": scalar(8e3, 1e3 / np.sqrt(3)),
        "reference": scalar(8.00e3, 0.05e3 / np.sqrt(3)),
    }
    law = propagate(model, inputs)
    assert law.value == pytest.approx(1.234, abs=1e-9)
    assert law.standard_uncertainty == pytest.approx(0.0539, abs=5e-5)
    assert np.sqrt(law.second_order_covariance[0, 0]) == pytest.approx(0.0750, abs=5e-5)


def test_correlated_inputs_and_several_outputs():
    """GUM H.2: resistance, reactance and impedance from five simultaneous observations, table H.4."""
    volt = [5.007, 4.994, 5.005, 4.990, 4.999]
    ampere = [19.663e-3, 19.639e-3, 19.640e-3, 19.685e-3, 19.678e-3]
    angle = [1.0456, 1.0438, 1.0468, 1.0428, 1.0433]
    observed = np.array([volt, ampere, angle])
    joint = Joint(observed.mean(1), np.cov(observed) / 5)

    def model(i):
        v, a, phi = i["observed"]
        return jnp.stack([v / a * jnp.cos(phi), v / a * jnp.sin(phi), v / a])

    law = propagate(model, {"observed": joint})
    np.testing.assert_allclose(law.value, [127.732, 219.847, 254.260], atol=5e-4)
    np.testing.assert_allclose(law.standard_uncertainty, [0.071, 0.295, 0.236], atol=1e-3)
    correlation = law.covariance / np.outer(law.standard_uncertainty, law.standard_uncertainty)
    np.testing.assert_allclose(correlation[[0, 0, 1], [1, 2, 2]], [-0.588, -0.485, 0.993], atol=2e-3)


def test_effective_degrees_of_freedom():
    """GUM G.4.1's example: Y = b X1 X2 X3, relative u 0.25 %, 0.57 %, 0.82 % with 10, 5, 15 observations: 19."""
    inputs = {name: scalar(1, u, n - 1) for name, u, n in [("a", 0.0025, 10), ("b", 0.0057, 5), ("c", 0.0082, 15)]}
    law = propagate(lambda i: i["a"] * i["b"] * i["c"], inputs)
    assert law.standard_uncertainty == pytest.approx(0.0103, abs=5e-5)
    assert law.degrees_of_freedom[0] == pytest.approx(19.0, abs=0.05)
    half = law.coverage_interval(0.95)[1] - law.value
    assert half == pytest.approx(student.ppf(0.975, law.degrees_of_freedom[0]) * 0.010296, rel=1e-3)
    exact = propagate(lambda i: i["a"], {"a": scalar(1, 0.1)})
    assert np.isinf(exact.degrees_of_freedom[0])


def test_a_students_t_enters_with_its_scale():
    class StudentT(NamedTuple):
        mean: np.ndarray
        scale: np.ndarray
        degrees_of_freedom: float

        @property
        def standard_deviation(self):
            return self.scale * np.sqrt(self.degrees_of_freedom / (self.degrees_of_freedom - 2))

    law = propagate(lambda i: 2 * i["a"], {"a": StudentT(np.array(1.0), np.array(0.1), 4.0)})
    assert law.standard_uncertainty == pytest.approx(0.2)
    assert law.coverage_interval(0.95)[1] == pytest.approx(2 + 0.2 * student.ppf(0.975, 4))


def test_contributions_close_and_are_shown():
    law = propagate(lambda i: i["b"] * i["a"][0] + i["a"][1], {"b": scalar(2, 0.1), "a": Given(np.ones(2), np.ones(2))})
    assert law.contributions["a"][0, 0] == pytest.approx(5)
    np.testing.assert_allclose(sum(law.contributions.values()), law.covariance)
    assert "u from a" in repr(law)
    assert law._repr_html_().startswith("<table>")


def test_bad_inputs_are_refused():
    with pytest.raises(ValueError, match="at least one input"):
        propagate(lambda i: jnp.zeros(()), {})
    with pytest.raises(ValueError, match="'a' a covariance of shape"):
        propagate(lambda i: i["a"], {"a": Joint(np.zeros(2), np.eye(3))})


def test_the_engines_distributions_are_inputs(generator):
    rows = generator.multivariate_normal([1, 2], [[2, 1], [1, 3]], size=50)
    inputs = {
        "limits": Rectangular(-1.0, np.array([1.0, 2.0])),
        "mean": StudentT(0.0, 0.5, 7.0),
        "joint": MultivariateNormal(np.zeros(2), np.array([[2.0, 1.0], [1.0, 3.0]])),
        "rows": Empirical(rows),
    }
    law = propagate(lambda i: sum(jnp.sum(x) for x in i.values()), inputs)
    assert law.contributions["limits"][0, 0] == pytest.approx(2**2 / 12 + 3**2 / 12)
    assert law.contributions["mean"][0, 0] == pytest.approx(0.25)
    assert law.contributions["joint"][0, 0] == pytest.approx(7)
    assert law.contributions["rows"][0, 0] == pytest.approx(rows.sum(1).var())
    u2 = law.covariance[0, 0]
    assert law.degrees_of_freedom[0] == pytest.approx(u2**2 / (0.25**2 / 7 + rows.sum(1).var() ** 2 / 49))
