"""How long to measure and which sensor to buy: closed forms, the law at other durations, Monte Carlo."""

import dataclasses

import numpy as np
import pytest

from uq import law, montecarlo
from uq.experiment.experiment import ExperimentError
from uq.monte_carlo.campaign.campaign_result import average as of_trials
from uq.plan.measurement.required_duration import GOALS, Growth, average, growth_of, lasting, required_duration
from uq.plan.measurement.sensor_worth import sensor_worth
from uq.report.figures.duration import duration_figure
from uq.sources.source import Source

NAMES = ("noise", "cg", "drift")


def closed(noise=4.0, cg=1.0, drift=0.0, duration=100.0, lost=20.0):
    """Variances of moments whose dependence on the duration is known in closed form."""
    variance = np.outer([noise, cg, drift], np.ones(6)) / 9
    nan = np.full(6, np.nan)
    power = np.outer([0, 0, 2], np.ones(6))
    return Growth(NAMES, duration, variance, np.stack([np.full(6, lost), nan, nan]), power, np.zeros(6))


@pytest.fixture(scope="module")
def experiment(preset):
    """T1 of 20 s at 100 Hz, one estimator matched to it."""
    spec = lasting(preset.trajectories["T1"], 60.0)
    spec = dataclasses.replace(
        spec, duration=20.0, rate=100.0,
        trajectory=dataclasses.replace(spec.trajectory, duration=np.array(20.0), ramp=np.array(3.0)),
    )  # fmt: skip
    return dataclasses.replace(preset, trajectories={"T1": spec}, estimators=preset.estimators[1:], document={})


@pytest.fixture(scope="module")
def growth(experiment):
    return growth_of(experiment)


@pytest.fixture(scope="module")
def longer(experiment):
    """The same of 40 s: every law and Monte Carlo below is compiled for this length or for 20 s."""
    return dataclasses.replace(experiment, trajectories={"T1": lasting(experiment.trajectories["T1"], 40.0)})


@pytest.fixture(scope="module")
def worth(longer):
    return sensor_worth(longer)


def test_variances_follow_their_closed_forms():
    variances = 9 * closed(drift=0.5).at(np.array([100.0, 180.0]))
    np.testing.assert_allclose(variances[:, 0, 0], [4.0, 4.0 * 80 / 160])
    np.testing.assert_allclose(variances[:, 1, 0], [1.0, 1.0])
    np.testing.assert_allclose(variances[:, 2, 0], [0.5, 0.5 * 1.8**2])


def test_the_duration_solves_its_equation(experiment, monkeypatch):
    """3σ of √(4·80/(T − 20) + 1) is 1.5 at T = 276; the law is told to agree."""
    made = closed()
    monkeypatch.setattr("uq.plan.measurement.required_duration._variances", lambda e, n, s, T, estimator: made.at(T))
    answer = required_duration(experiment, 1.5, growth=made)
    assert answer.seconds == pytest.approx(20 + 4 * 80 / 1.25, rel=1e-4)
    assert answer.reached == pytest.approx(1.5, rel=1e-4)
    assert answer.reachable


def test_a_very_long_answer_is_extrapolated(experiment, monkeypatch):
    """Two million samples at 100 Hz are 20,000 s: beyond, the law is not asked, which would take long."""
    made = closed(cg=0.0)
    monkeypatch.setattr("uq.plan.measurement.required_duration._variances", lambda *_: pytest.fail("the law was asked"))
    answer = required_duration(experiment, 0.1, growth=made)
    assert answer.seconds == pytest.approx(20 + 4 * 80 / 0.1**2, rel=1e-4)
    assert answer.reached == pytest.approx(0.1, rel=1e-4)
    assert not answer.checked
    assert "extrapolated" in repr(answer)


def test_a_constant_source_forbids_what_is_below_it(experiment):
    answer = required_duration(experiment, 0.99, growth=closed())
    assert (answer.seconds, answer.forbids) == (None, "cg")
    assert answer.reached == pytest.approx(1.0, rel=1e-3)
    assert "no duration reaches it" in repr(answer)
    assert "cg forbids it" in repr(answer)


def test_a_drift_forbids_to_wait_any_longer(experiment):
    answer = required_duration(experiment, 1.6, growth=closed(drift=0.5))
    assert answer.seconds is None
    assert required_duration(experiment, 1.6, growth=closed(drift=0.5)).forbids in ("noise", "cg", "drift")
    t = np.linspace(60, 1000, 20000)
    assert answer.reached == pytest.approx(np.sqrt(4 * 80 / (t - 20) + 1 + 0.5 * (t / 100) ** 2).min(), rel=1e-3)


def test_a_longer_trajectory_keeps_frequencies_and_ramps(preset):
    for name in ("T1", "T3"):
        spec = preset.trajectories[name]
        longer = lasting(spec, 300.0)
        assert (longer.duration, float(longer.trajectory.duration)) == (300.0, 300.0)
        assert longer.trajectory.ramp == spec.trajectory.ramp
        assert longer.trajectory.angular_velocity == spec.trajectory.angular_velocity
    sphere = lasting(preset.trajectories["T1"], 300.0).trajectory
    assert float(sphere.precessions / sphere.duration) == pytest.approx(10 / 180)
    with pytest.raises(ExperimentError, match="do not hold two ramps of 27 s"):
        lasting(preset.trajectories["T1"], 50.0)


@pytest.mark.slow
def test_the_answer_holds_in_the_monte_carlo(longer, growth):
    """400 trials: the average 3σ has a standard error of about 2.5 %; within four of them (6e-5)."""
    target = average(growth.three_sigma(40.0), "moments")
    answer = required_duration(longer, target, growth=growth)
    assert answer.seconds == pytest.approx(40.0, rel=1e-3)
    assert answer.reached == pytest.approx(target, rel=2e-3)
    trials = montecarlo(longer, trials=400)
    got = of_trials(trials, "T1", "smoothed", GOALS["moments"])
    assert abs(got.three_sigma - answer.target) < 4 * got.three_sigma_standard_error


def test_the_centre_of_gravity_forbids_too_small_a_target(experiment, growth):
    answer = required_duration(experiment, 1e-5, growth=growth)
    assert answer.forbids == "r_cg"
    assert 0 < answer.reached < answer.now


@pytest.mark.parametrize(
    ("given", "message"),
    [({"target": 0.0}, "a target of 0 g·m²"), ({"target": float("nan")}, "a target of nan"),
     ({"target": 1e-3, "goal": "mass"}, "unknown goal 'mass'"), ({"target": 1e-3, "trajectory": "T9"}, "T9"),
     ({"target": 1e-3, "estimator": "none"}, "unknown estimator 'none'")],
)  # fmt: skip
def test_bad_targets(experiment, given, message):
    with pytest.raises(ExperimentError, match=message):
        required_duration(experiment, **given)


# --- sensors ---


def test_derivatives_add_up_to_one(worth):
    """Sources that add in squares: the 3σ is of the first degree in all sigmas together."""
    np.testing.assert_allclose(worth.derivative.sum(axis=0), 1, atol=2e-3)


def test_a_derivative_is_the_sources_share_of_the_variance(longer, worth):
    breakdown = law(longer, "T1", "smoothed")["T1", "smoothed"]
    shares = [
        np.diag(breakdown.sources[name].covariance) / np.diag(breakdown.total.covariance) for name in worth.sources
    ]
    np.testing.assert_allclose(worth.derivative, shares, atol=3e-3)


@pytest.mark.slow
def test_a_halved_sigma_does_what_the_monte_carlo_says(longer, worth):
    """The same draws serve both campaigns, so that the ratio is better known than either figure, 1 %: 3 % are ample."""
    k = worth.sources.index(worth.best)
    sources = tuple(s.resized(0.5) if i == k else s for i, s in enumerate(longer.sources))
    first, two = (
        montecarlo(e, trials=4000)["T1", "smoothed"].total.three_sigma
        for e in (longer, dataclasses.replace(longer, sources=sources))
    )
    assert worth.best == "M_precision"
    np.testing.assert_allclose(two / first, worth.halved[k] / worth.three_sigma, rtol=0.03)


def test_the_table_is_led_by_the_best(worth):
    (table,) = worth.tables()
    head, rows = table.head, table.rows
    assert rows[0][0] == "none"
    assert rows[1][0] == worth.best.replace("_", " ")
    assert len(rows) == 1 + len(worth.sources)
    assert all(len(row) == len(head) for row in rows)
    assert worth.to_dict()["sources"]["r_cg"]["derivative"]["I11"] == worth.derivative[worth.sources.index("r_cg"), 0]


def test_every_size_of_a_source_is_resized():
    settings = {"white": np.ones(3), "flicker": np.ones(3), "random_walk": np.ones(3), "centre": np.ones(3)}
    source = Source("s", "omega", "coloured", "imu", np.ones(3), settings=settings, mean=5.0)
    resized = source.resized(0.5)
    assert all((resized.settings[name] == 0.5).all() for name in ("white", "flicker", "random_walk"))
    assert (resized.settings["centre"] == 1).all()
    assert (resized.sigma == 0.5).all()
    assert resized.mean == 5.0


# --- at full length, with as many trials as the paper ---


@pytest.mark.study
def test_duration_and_sensor_of_the_preset_in_10000_trials(preset, capsys):
    """T1 of 180 s: the duration for 2.4 g·m², and M's noise halved, each in a Monte Carlo of 10,000 trials.

    The average 3σ has a standard error of about 0.5 %; both figures within four of them (1.3e-4).
    """
    answer = required_duration(preset, 2.4e-3, trajectory="T1", estimator="smoothed")
    worth = sensor_worth(preset, "T1", "smoothed")
    k = worth.sources.index("M_precision")
    quieter = tuple(s.resized(0.5) if s.name == "M_precision" else s for s in preset.sources)
    specs = {"T1": lasting(preset.trajectories["T1"], answer.seconds)}
    cases = {
        "duration": (dataclasses.replace(preset, trajectories=specs, document={}), answer.target),
        "sensor": (
            dataclasses.replace(preset, sources=quieter, document={}),
            average(worth.halved[k], "moments"),
        ),
    }
    for name, (experiment, expected) in cases.items():
        trials = montecarlo(experiment, trials=10_000, trajectories="T1", estimators="smoothed")
        got = of_trials(trials, "T1", "smoothed", GOALS["moments"])
        with capsys.disabled():
            print(f"\n{name}: {answer.seconds:.1f} s, predicted {1e3 * expected:.4f} g·m², 10,000 trials "
                  f"{1e3 * got.three_sigma:.4f} ± {1e3 * got.three_sigma_standard_error:.4f}")  # fmt: skip
        assert abs(got.three_sigma - expected) < 4 * got.three_sigma_standard_error


def test_the_figure_shows_what_can_be_seen():
    """Of a drift that is nearly nought no line, and no row of the legend."""
    for drift, names in ((1e-12, ["total", "noise", "CG"]), (1.0, ["total", "noise", "CG", "drift"])):
        figure = duration_figure(closed(drift=drift), {"moments": [1e-3]})
        panel = figure.axes[-1]
        assert [text.get_text() for text in panel.get_legend().get_texts()] == names
        noise = figure.axes[0].lines[1]
        np.testing.assert_allclose(noise.get_ydata() / 1e3, 2 * np.sqrt(80 / (noise.get_xdata() - 20)), rtol=1e-9)
