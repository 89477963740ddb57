"""Which cases go by sums, by samples or once, and why; the same distribution whichever way."""

import dataclasses
import tomllib
from itertools import product
from pathlib import Path

import jax
import numpy as np
import pytest
from scipy import stats

from tests.helpers.source_lab import BY_SAMPLES, experiment, source
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import RunOptions, montecarlo
from uq.monte_carlo.campaign.trial_setup import prepare_engine
from uq.monte_carlo.gram_sums.cases import cases_of

NOISE = [
    source("F_noise", "F", "precision", sigma=["5 N", "5 N", "10 N"]),
    source("M_noise", "M", "precision", sigma=["0.4 N*m"] * 3),
    source("w_noise", "omega", "precision", sigma=["2 mrad/s"] * 3),
]
STEPS = [
    source("F_step", "F", "quantisation", step=["10 N", "10 N", "20 N"]),
    source("M_step", "M", "quantisation", step=["0.8 N*m"] * 3),
    source("w_step", "omega", "quantisation", step=["4 mrad/s"] * 3),
]
"""As coarse as the noise allows."""


def how(e, estimator="central"):
    """What a result says of how its engine was chosen."""
    return prepare_engine(e, e.trajectories["T"], [e.estimator(estimator)])[1]


def figures(e, **options):
    """3σ and mean error of all sources together, then their standard errors."""
    total = montecarlo(e, estimators="smoothed", **options)["T", "smoothed"].total
    return [
        np.concatenate([getattr(total, f"{figure}{suffix}") for figure in ("mean_error", "three_sigma")])
        for suffix in ("", "_standard_error")
    ]


ROUNDED = [*NOISE[1:], *STEPS[1:]]
FINE = [*NOISE[1:], *(step | {"step": ["1e-6 " + step["step"][0].split()[1]] * 3} for step in STEPS[1:])]
"""The same with steps that nobody sees: the same shapes, compiled once."""


@pytest.fixture(scope="module")
def of_samples():
    return figures(experiment(*ROUNDED), trials=1000, plan=BY_SAMPLES)


@pytest.fixture(scope="module")
def without():
    return figures(experiment(*FINE), trials=3000)


@pytest.mark.slow
def test_quantisation_in_sums_is_quantisation_of_samples(of_samples, without):
    """At the coarsest step that counts as noise, which widens 3σ by a sixth; 12 figures at 4.5: 1e-4 false alarms."""
    sums, error = figures(experiment(*ROUNDED), trials=3000)
    samples, error_of_samples = of_samples
    assert (np.abs(sums - samples) < 4.5 * np.hypot(error, error_of_samples)).all()
    assert np.max(np.abs(without[0] - samples) / np.hypot(error, error_of_samples)) > 4.5  # it would be seen


MORE = {
    "delay": [source("late", "omega", "delay", sigma="1 ms")],
    "flicker": [
        source("F_flicker", "F", "coloured", flicker=["2 N"] * 3),
        source("w_flicker", "omega", "coloured", flicker=["1 mrad/s"] * 3),
    ],
    "quantisation": [
        source("F_step", "F", "quantisation", step=["10 N", "10 N", "20 N"]),
        source("M_step", "M", "quantisation", step=["0.7 N*m"] * 3),
        source("w_step", "omega", "quantisation", step=["0.7 mrad/s"] * 3),
    ],
}


@pytest.mark.study
@pytest.mark.parametrize("more", MORE)
def test_ten_thousand_trials_either_way(more):
    """T1 in ten seconds, 4,000 samples, the preset's noise: within 1 % or four standard errors of the difference."""
    document = tomllib.loads(Path("uq/examples/t1-10s.toml").read_text("utf-8"))
    e = Experiment.from_dict(document | {"source": [*document["source"], *MORE[more]]})
    reference, result = montecarlo(e, trials=10_000, plan=BY_SAMPLES), montecarlo(e, trials=100_000)
    worst, largest = 0.0, 0.0
    for estimator, figure in product(("central", "smoothed"), ("three_sigma", "mean_error")):
        totals = [campaign["T1", estimator].total for campaign in (result, reference)]
        value, expected = (getattr(total, figure) for total in totals)
        error = np.hypot(*(getattr(total, f"{figure}_standard_error") for total in totals))
        excess = np.abs(value - expected)
        assert (excess <= np.maximum(0.01 * np.abs(expected), 4 * error)).all(), (estimator, figure)
        worst = max(worst, np.max(excess / error))
        largest = max(largest, np.max(excess / expected) if figure == "three_sigma" else 0)
    print(f"{more}: {worst:.1f} standard errors at most, 3σ within {largest:.2%}")


def test_a_coarse_step_gets_samples_and_a_step_alone_is_computed_once():
    fine, coarse = (source("step", "F", "quantisation", step=[s] * 3) for s in ("10 N", "10.1 N"))
    words = {"in_sums": {"step": "white noise of variance step²/12"}, "once": ["group:group of step", "source:step"]}
    assert how(experiment(NOISE[0], fine)) == words
    reason = {"total": "step is coarse against the noise beside it"}
    assert how(experiment(NOISE[0], coarse)) == {"by_samples": reason, "once": words["once"]}


def test_noise_that_does_not_round_independently_gets_samples():
    """Correlated noise, noise of another distribution, two steps on one signal, and the end of the range."""
    step, one = source("step", "F", "quantisation", step=["1 N"] * 3), [[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1]]
    rectangular = source("F_noise", "F", "precision", distribution="rectangular", half_width=["9 N"] * 3)
    correlated = source("F_noise", "F", "precision", sigma=["5 N"] * 3, correlation=one)
    other = source("other", "F", "quantisation", step=["0.5 N"] * 3)
    limit = source("limit", "F", "saturation", limit=["100 N"] * 3)
    for sources, word in (
        ([rectangular, step], "coarse against"),
        ([correlated, step], "coarse against"),
        ([NOISE[0], step, other], "one of several resolutions"),
        ([NOISE[0], limit], "within reach"),
    ):
        reasons = how(experiment(*sources))["by_samples"]
        assert list(reasons) == ["total"]
        assert word in reasons["total"]
    white = source("F_noise", "F", "coloured", white=["1 N*s**0.5"] * 3)
    assert "by_samples" not in how(experiment(white, step))


def test_a_range_that_is_far_needs_no_samples():
    """The force goes to 195 N, and its noise to 6 × 10 N beyond."""
    near, far = (source("limit", "F", "saturation", limit=[limit] * 3) for limit in ("250 N", "256 N"))
    assert list(how(experiment(NOISE[0], near))["by_samples"]) == ["total"]
    words = {"limit": "nothing: the signal stays within its range"}
    assert how(experiment(NOISE[0], far)) == {"in_sums": words}


def test_noise_whose_moments_sums_do_not_hold_gets_samples():
    """No fourth moment; noise of two sources that go together."""
    heavy = source("w", "omega", "precision", distribution="student_t", scale=["2 mrad/s"] * 3, degrees_of_freedom=3)
    normal, other = (source(name, "omega", "precision", sigma=["0.2 mrad/s"] * 3) for name in "uv")
    crossed = experiment(
        normal, other, NOISE[0], correlations=[{"sources": ["u", "v"], "coefficient": np.eye(3).tolist()}]
    )
    with_cell = experiment(NOISE[0], normal, correlations=[{"sources": ["F_noise", "u"], "coefficient": 0.5}])
    reasons = how(experiment(heavy))["by_samples"]
    assert list(reasons) == ["total", "group:group of w", "source:w"]
    assert reasons["total"] == "w has no fourth moment"
    for e in (crossed, with_cell):
        assert how(e)["by_samples"] == {"total": "noise of the gyro is correlated with other noise"}


@pytest.mark.parametrize(
    ("large", "small", "duration", "word"),
    [("12 mrad/s", "9 mrad/s", "40 s", "% of the motion"), ("3 mrad/s", "1 mrad/s", "4 s", "skew the trials by 0.")],
)
def test_noise_that_is_large_or_skews_so_few_samples_gets_samples(large, small, duration, word):
    """The first by its size in a run that is long, the second by the number of samples."""
    noise = [source("w", "omega", "precision", sigma=[sigma] * 3) for sigma in (large, small)]
    reasons = how(experiment(noise[0], duration=duration))["by_samples"]
    assert list(reasons) == ["total", "group:group of w", "source:w"]
    assert all(word in reason for reason in reasons.values())
    assert how(experiment(noise[1], duration=duration)) == {}


@pytest.mark.slow
def test_the_predicted_skewness_is_that_of_trials(monkeypatch):
    """Of 4,000 trials by samples, standard error 0.04, and by a factor of two: what it decides is no finer."""
    e = experiment(source("w", "omega", "precision", sigma=["8 mrad/s"] * 3), duration="2 s", ramp="0.5 s")
    monkeypatch.setattr("uq.monte_carlo.trials.chooser.LARGEST_NOISE", 1.0)
    predicted = float(how(e)["by_samples"]["total"].rpartition(" ")[2])
    errors = montecarlo(e, trials=4000, plan=BY_SAMPLES, estimators="central").errors["T"][:, 0, 0]
    largest = np.abs(stats.skew(errors)).max()
    assert predicted / 2 < largest < predicted


@pytest.fixture(scope="module")
def three_ways():
    """Cases by sums, by samples and once; without noise of the load cell, whose sums are drawn."""
    limit = source("limit", "omega", "saturation", limit=["0.3 rad/s"] * 3)
    noise = source("w_noise", "omega", "precision", sigma=["0.5 mrad/s"] * 3)
    return experiment(noise, limit, source("bias", "F", "bias", sigma=["1 N"] * 3))


@pytest.fixture(scope="module")
def campaign(three_ways):
    return montecarlo(three_ways, trials=5, seed=3)


@pytest.fixture(scope="module")
def split(campaign):
    return campaign.errors["T"]


def test_a_result_says_how_its_cases_were_computed(three_ways, campaign):
    assert campaign.provenance["computed"] == {"T": how(three_ways)}
    (reason,) = how(three_ways)["by_samples"].values()
    assert f"T, total by samples: {reason}" in campaign.section().computed[0]


def test_cases_by_samples_are_those_of_a_campaign_by_samples(three_ways, split):
    """Beside cases on sums, which draw the gyro's noise otherwise, but constants alike."""
    plain = montecarlo(three_ways, trials=5, plan=BY_SAMPLES, seed=3).errors["T"]
    computed, cases = how(three_ways), [case.name for case in cases_of(three_ways.sources)]
    drawn_otherwise = [k for k, name in enumerate(cases) if name in ("source:w_noise", "group:group of w_noise")]
    drawn_the_same = [k for k in range(len(cases)) if k not in drawn_otherwise]
    assert list(computed["by_samples"]) == ["total"]
    assert computed["once"] == ["group:group of limit", "source:limit"]
    np.testing.assert_allclose(split[:, :, drawn_the_same], plain[:, :, drawn_the_same], atol=1e-12)
    assert np.abs(np.diff(plain[:, 0, :2], axis=1)).min() > 0
    assert np.abs(split[:, :, drawn_otherwise] - plain[:, :, drawn_otherwise]).min() > 0


@pytest.mark.slow
def test_batches_and_devices_change_nothing(three_ways, split):
    options = RunOptions(devices=jax.devices()[:2], batch=2)
    other = montecarlo(three_ways, trials=5, seed=3, options=options).errors["T"]
    np.testing.assert_allclose(split, other, atol=1e-13)


@pytest.mark.parametrize("sigma", ["1 ms", "10 ms", "30 ms"])
def test_a_delay_is_a_polynomial_where_that_is_good_enough(sigma):
    computed = how(experiment(source("late", "omega", "delay", sigma=sigma)))
    if sigma == "30 ms":
        assert set(computed["by_samples"].values()) == {"late is too long for a polynomial"}
        assert len(computed["by_samples"]) == 3
    else:
        assert computed == {"in_sums": {"late": "a polynomial in the delay"}}


@pytest.mark.slow
def test_nothing_to_do_by_sums():
    """Every case needs samples, or none is drawn at all."""
    limit = source("limit", "F", "saturation", limit=["100 N"] * 3)
    e = experiment(limit)
    errors = montecarlo(e, trials=3).errors["T"]
    assert (errors == errors[0]).all()
    assert np.abs(errors).max() > 1e-3
    plain = montecarlo(e, trials=1, plan=BY_SAMPLES).errors["T"]
    np.testing.assert_allclose(errors[:1], plain, atol=1e-15)
    silent = dataclasses.replace(e, sources=())
    np.testing.assert_allclose(montecarlo(silent, trials=1).errors["T"][0, 0], 0, atol=1e-2)
