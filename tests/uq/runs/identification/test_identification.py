"""Identification of runs: exact without noise, honest with it, and clear about what a motion cannot tell."""

import dataclasses
from itertools import product

import jax
import numpy as np
import pytest

from identify.floating_point import PrecisionWarning
from identify.identification import identify
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run, RunError
from tests.helpers.recordings import silenced
from uq.monte_carlo.campaign.campaign import montecarlo
from uq.monte_carlo.campaign.simulation import simulate

SMOOTHED = EstimatorSpec("smoothed", "savitzky-golay", band=1.55)
FILTERED = EstimatorSpec("filtered", "central", lowpass=4.0)


@pytest.mark.parametrize(
    ("name", "estimator"),
    [
        *(("T1", estimator) for estimator in (SMOOTHED, None)), ("T2", SMOOTHED), ("T3", SMOOTHED),
        pytest.param("T1", FILTERED, marks=pytest.mark.slow),  # and its central difference: below
        *(pytest.param(*case, marks=pytest.mark.study) for case in product(("T2", "T3"), (FILTERED, None))),
    ],
)  # fmt: skip
def test_a_silent_run_gives_the_tensor(short, name, estimator):
    result = identify(simulate(silenced(short), name).run, r_cg=short.r_cg_from_q, estimator=estimator)
    # a smoother's gain holds within 1e-4 over its band; the ramps of a short run reach a little beyond it
    np.testing.assert_allclose(result.inertia, short.inertia, atol=3e-4 * short.inertia.max())
    assert np.abs(result.inertia - result.bias - short.inertia).max() < 1e-4 * short.inertia.max()


def test_a_filter_on_both_sides_changes_nothing_but_the_central_differences_gain(short, unjudged):
    """Behind the filter each side is smoothed alike, so the error stays that of the central difference: (Ω dt)²/6."""
    result = identify(simulate(silenced(short), "T1").run, r_cg=short.r_cg_from_q, estimator=FILTERED)
    relative = (result.inertia / np.where(short.inertia == 0, 1, short.inertia))[[0, 3, 5]] - 1
    np.testing.assert_allclose(relative, (4 / 0.425 / 400) ** 2 / 6, rtol=0.1)


@pytest.mark.parametrize("estimator", [SMOOTHED, FILTERED])
def test_offsets_are_removed_where_asked_and_only_there(short, estimator, unjudged):
    run = simulate(silenced(short), "T1").run
    shifted = dataclasses.replace(run, force=run.force + [2.0, -1.0, 3.0], moment=run.moment + [0.7, -0.4, 0.5])
    options = {"r_cg": short.r_cg_from_q, "estimator": estimator}
    reference = identify(run, offsets="estimate", **options)
    removed = identify(shifted, offsets="estimate", **options)
    np.testing.assert_allclose(removed.inertia, reference.inertia, atol=1e-12)
    expected = np.array([0.7, -0.4, 0.5]) - np.cross(short.r_cg_from_q, [2.0, -1.0, 3.0])
    offsets = [result.runs[0].offsets.moment for result in (removed, reference)]
    np.testing.assert_allclose(offsets[0] - offsets[1], expected, atol=1e-9)
    left_in = identify(shifted, offsets="none", **options)
    assert np.abs(left_in.inertia - reference.inertia).max() > 1e-5
    assert left_in.runs[0].offsets is None


@pytest.mark.parametrize(
    ("estimator", "runs"),
    [
        pytest.param(SMOOTHED, 10, marks=pytest.mark.slow),
        *(pytest.param(spec, 24, marks=pytest.mark.study) for spec in (SMOOTHED, FILTERED)),
    ],
)
def test_intervals_cover_the_truth(short, estimator, runs, unjudged):
    """Without biases, runs x 6 components: three binomial standard errors, were they fully correlated.

    Of 10 runs the scatter tells a standard deviation to 24 %, of 24 to 15 %: three of it.
    """
    noisy = dataclasses.replace(short, sources=tuple(s for s in short.sources if s.kind == "precision"))
    covered, uncertainties, estimates = [], [], []
    for trial in range(runs):
        result = identify(simulate(noisy, "T1", trial=trial).run, r_cg=short.r_cg_from_q, estimator=estimator)
        low, high = result.interval95.T
        covered.append((low <= short.inertia) & (short.inertia <= high))
        uncertainties.append(result.standard_uncertainty)
        estimates.append(result.inertia)
    assert 0.95 - 3 * np.sqrt(0.95 * 0.05 / runs) < np.mean(covered) <= 1
    np.testing.assert_allclose(
        np.mean(uncertainties, axis=0), np.std(estimates, axis=0, ddof=1), rtol=3 / np.sqrt(2 * (runs - 1))
    )


def test_the_centre_of_gravitys_uncertainty_is_propagated(short, unjudged):
    """The spread over drawn centres is the stated part of the uncertainty: linear, so to rounding of 400 draws."""
    run = simulate(silenced(short), "T2").run
    sigma = 10 * short.sigma_r_cg
    stated = identify(run, r_cg=short.r_cg_from_q, sigma_r_cg=sigma, estimator=SMOOTHED)
    plus = [identify(run, r_cg=short.r_cg_from_q + s, estimator=SMOOTHED).inertia for s in np.diag(sigma)]
    expected = np.sqrt(np.sum((np.array(plus) - stated.inertia) ** 2, axis=0))
    np.testing.assert_allclose(stated.diagnostics["standard_uncertainty_from_cg"], expected, rtol=1e-6)
    np.testing.assert_allclose(stated.standard_uncertainty, expected, rtol=1e-2)


@pytest.mark.slow
def test_the_stated_bias_is_the_monte_carlos_mean_error(short):
    """Central differences of the gyro's noise: the mean error of 150 trials, and what one run says of it."""
    campaign = montecarlo(short, trials=150, trajectories=["T1"], estimators=["central"])
    result = identify(simulate(short, "T1").run, r_cg=short.r_cg_from_q, estimator=short.estimator("central"))
    mean = campaign["T1", "central"].total
    assert mean.mean_error[5] < -0.02
    np.testing.assert_allclose(result.bias[5], mean.mean_error[5], rtol=0.08)
    assert any("gyro noise and differentiator bias I33 by about −" in text for text in result.warnings)
    smooth = identify(simulate(short, "T1").run, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert np.abs(smooth.bias).max() < 3e-4
    assert not any("bias" in text for text in smooth.warnings)


@pytest.mark.parametrize(
    ("rate", "lowpass"),
    [
        (100.0, 4.0),
        (400.0, None),
        *(pytest.param(*case, marks=pytest.mark.study) for case in ((100.0, None), (400.0, 4.0))),
    ],
)
def test_the_stated_bias_holds_the_differentiators_gain(short, rate, lowpass, unjudged):
    """Central differences of a silent run: what they lack is known from their gain, and said."""
    run, every = simulate(silenced(short), "T1").run, round(400 / rate)
    run = Run.from_arrays(*(values[::every] for values in (run.t, run.force, run.moment, run.omega)))
    central = EstimatorSpec("central", "central", lowpass=lowpass)
    result = identify(run, r_cg=short.r_cg_from_q, estimator=central)
    error = (result.inertia - short.inertia)[[0, 3, 5]]
    np.testing.assert_allclose(result.bias[[0, 3, 5]], error, rtol=0.1)


def test_a_gap_costs_samples_and_not_the_answer(short):
    """Without 2 s of angular velocity the answer stays within its uncertainty; nothing is made up for them."""
    run = simulate(silenced(short, "r_cg"), "T1").run
    keep = (run.t < 8) | (run.t > 10)
    gapped = Run.from_channels(run.t, run.force, run.moment, run.t[keep], run.omega[keep])
    whole, cut = (identify(r, r_cg=short.r_cg_from_q, estimator=SMOOTHED) for r in (run, gapped))
    assert whole.runs[0].samples - cut.runs[0].samples == pytest.approx(800, abs=60)
    assert (np.abs(cut.inertia - whole.inertia) < 2 * whole.standard_uncertainty).all()
    assert any("1 gap in the angular velocity" in text for text in cut.warnings)


def test_a_flat_plate_is_not_called_impossible(short, unjudged):
    """On the edge of the triangle inequality noise decides; only a clear violation is worth a warning."""
    plate = dataclasses.replace(short, inertia=np.array([0.19, 0.0, 0.0, 0.19, 0.0, 0.38]))
    for trial in range(2):
        result = identify(simulate(plate, "T1", trial=trial).run, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
        assert not any("no mass distribution" in text for text in result.warnings)


def test_runs_of_one_name_are_kept_apart(short, unjudged):
    runs = [simulate(short, "T1", trial=k).run for k in range(2)]
    content = identify(runs, r_cg=short.r_cg_from_q, estimator=SMOOTHED, offsets="estimate").to_dict()
    assert len(content["offsets"]["moment"]) == 2
    assert content["offsets"]["moment"][0] != content["offsets"]["moment"][1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"r_cg": (0, 0, np.nan)}, "r_cg is"),
        ({"r_cg": (0, 0)}, "r_cg is"),
        ({"r_cg": (0, 0, 0), "sigma_r_cg": (0, -1e-3, 0)}, "sigma_r_cg is"),
    ],
)
def test_numbers_that_cannot_be_are_refused(short, options, words):
    with pytest.raises(RunError, match=words):
        identify(simulate(silenced(short), "T1").run, **options)


def test_a_still_run_and_a_brief_one_are_refused(short):
    run = simulate(silenced(short), "T1").run
    still = dataclasses.replace(run, omega=0 * run.omega)
    with pytest.raises(RunError, match="never changes: record a body that turns to and fro"):
        identify(still, r_cg=(0, 0, 0), estimator=SMOOTHED)
    with pytest.raises(RunError, match="fewer than the 64 from which a motion's band is found"):
        identify(run.between(0.0, 0.1), r_cg=(0, 0, 0))


@pytest.mark.parametrize("wrong", [{"lowpass": -3.0}, {"band": 0.0}, {"window": 0}])
def test_an_estimator_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="Argument"):
        EstimatorSpec(**({"name": "x", "differentiator": "central"} | wrong))


def test_runs_about_one_axis_each_identify_together(short, unjudged):
    run = simulate(silenced(short), "T3").run
    segment = run.t[-1] / 3
    segments = [run.between(k * segment, (k + 1) * segment) for k in range(3)]
    for segment_run, blind in zip(segments, ("I22, I23, I33", "I11, I13, I33", "I11, I12, I22"), strict=True):
        alone = identify(segment_run, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
        assert any(f"{blind} not determined: the body turns about one axis only" in text for text in alone.warnings)
    together = identify(segments, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    np.testing.assert_allclose(together.inertia, short.inertia, atol=3e-4 * short.inertia.max())
    assert not any(run.alone for run in together.runs)
    assert together.to_dict()["runs"][0]["inertia"] is None


def test_noise_in_the_unexcited_axes_does_not_pass_for_excitation(short, unjudged):
    run = simulate(silenced(short, "r_cg"), "T3").run
    result = identify(run.between(0.0, run.t[-1] / 3), r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert result.admissible is not None
    np.testing.assert_array_equal(result.admissible.determined, [True, True, True, False, False, False])


def test_several_runs_tell_more_and_their_scatter_counts(short, unjudged):
    runs = [simulate(silenced(short, "r_cg"), "T1", trial=k).run for k in range(5)]
    single = identify(runs[0], r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    five = identify(runs, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert (five.standard_uncertainty < single.standard_uncertainty).all()
    mean = np.mean([run.inertia for run in five.runs], axis=0)
    np.testing.assert_allclose(five.inertia, mean, atol=0.2 * single.standard_uncertainty.max())
    other = dataclasses.replace(runs[0], moment=1.2 * runs[0].moment, force=1.2 * runs[0].force)
    scattered = identify([*runs, other], r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert scattered.standard_uncertainty[0] > 3 * five.standard_uncertainty[0]
    assert any(text.startswith("the runs scatter") and "I11" in text for text in scattered.warnings)


def test_a_tensor_that_no_body_has_is_called_so(short):
    run = simulate(silenced(short), "T1").run
    reversed_sign = dataclasses.replace(run, force=-run.force, moment=-run.moment)
    result = identify(reversed_sign, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert any("no mass distribution has this tensor" in text for text in result.warnings)


def test_the_readmes_arrays_need_no_file(short):
    run = simulate(short, "T1").run
    result = identify(Run.from_arrays(run.t, run.force, run.moment, run.omega), r_cg=(0, 0, 0.053))
    assert result.estimator.name.startswith("savitzky-golay, band ")
    assert np.all(np.abs(result.inertia - short.inertia) < 4 * result.standard_uncertainty + 1e-4)
    text, html = repr(result), result._repr_html_()
    for name in ("I11", "I23", "standard uncertainty", "assumed: "):
        assert name in text
    assert "<table>" in html


def test_the_result_is_the_contract(short):
    result = identify(simulate(short, "T1").run, r_cg=short.r_cg_from_q, estimator=SMOOTHED, mass=19.7)
    content = result.to_dict()
    assert list(content)[:6] == ["kind", "version", "status", "unit", "about", "frame"]
    assert list(content)[6:10] == ["inertia", "bias", "standard_uncertainty", "interval95"]
    assert content["inertia"]["I33"] == result.inertia[5]
    low, high = content["interval95"]["I12"]
    assert low < content["inertia"]["I12"] < high
    covariance = np.array(content["covariance"])
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), list(content["standard_uncertainty"].values()))
    np.testing.assert_allclose(covariance, covariance.T)
    axes = np.array(content["principal"]["axes"])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert content["mass"]["value"] == 19.7


def test_too_short_too_slow_and_no_runs_are_refused(short):
    run = simulate(silenced(short), "T1").run
    with pytest.raises(RunError, match="no runs"):
        identify([], r_cg=(0, 0, 0))
    with pytest.raises(RunError, match="fewer than the 41 that estimator 'smoothed' needs at 400 Hz"):
        identify(run.between(0.0, 0.05), r_cg=(0, 0, 0), estimator=SMOOTHED)
    with pytest.raises(RunError, match="400 Hz, too few to differentiate a motion of 100 Hz"):
        identify(run, r_cg=(0, 0, 0), estimator=EstimatorSpec("fast", "savitzky-golay", band=100.0))


def test_without_float64_it_warns_also_in_the_result(short):
    run = simulate(silenced(short), "T1").run
    with jax.enable_x64(False), pytest.warns(PrecisionWarning, match="JAX's float64 is off"):
        result = identify(run, r_cg=short.r_cg_from_q, estimator=SMOOTHED)
    assert "computed in float32" in result.warnings[0]
    np.testing.assert_allclose(result.inertia, short.inertia, atol=1e-3 * short.inertia.max())
