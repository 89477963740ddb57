"""What a platform really did: runs with planted amplitude, lag and a moving centre of gravity."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from identify.motion.trajectory import Trajectory
from identify.signals.run import RunError
from tests.helpers.recordings import silenced
from uq.campaign.simulation import simulate
from uq.cli.main import main
from uq.experiment.experiment import Experiment, ExperimentError
from uq.files.toml_text import toml_text
from uq.recorded.load_run import load_run
from uq.tracking.achieved_motion import MeasuredRotation, achieved, follow
from uq.tracking.centre_stillness import SLOWEST

GAIN, LAG = 0.93, 0.0373
RATE, SECONDS = 100, 20.0


class Late(Trajectory):
    """A trajectory that begins later."""

    plan: Trajectory
    lag: Array
    duration: Array
    ramp: Array

    def omega(self, t):
        return self.plan.omega(t - self.lag)


@pytest.fixture(scope="module")
def experiment(preset):
    document = dict(preset.document)
    short = {"duration": f"{SECONDS} s", "ramp": "3 s", "rate": f"{RATE} Hz"}
    document["trajectory"] = {
        name: {**document["trajectory"][name], **short, **({"precessions": 1} if name == "T1" else {})}
        for name in ("T1", "T3")
    }
    document["estimator"] = document["estimator"][1:]
    return Experiment.from_dict(document)


def ran(experiment, path, *, gain=1.0, lag=0.0, quiet=False, r_cg_from_omb=None):
    """A recorded run of T1 by a platform that is small and late, or that turns about another point."""
    spec = experiment.trajectories["T1"]
    moved = Late(spec.trajectory.scaled(gain), jnp.array(lag), jnp.array(SECONDS + 1), spec.trajectory.ramp)
    real = dataclasses.replace(spec, trajectory=moved, duration=SECONDS + 1)
    if r_cg_from_omb is not None:  # the platform's centre keeps still, so that the true centre of gravity moves
        real = dataclasses.replace(real, still="omb")
        experiment = dataclasses.replace(experiment, r_cg_from_omb=r_cg_from_omb)
    sources = silenced(experiment).sources if quiet else experiment.sources
    simulated = simulate(dataclasses.replace(experiment, trajectories={"T1": real}, sources=sources, document={}), "T1")
    simulated.write(path, overwrite=True)
    return path


@pytest.fixture(scope="module")
def late(experiment, tmp_path_factory):
    return ran(experiment, tmp_path_factory.mktemp("achieved") / "run.mcap", gain=GAIN, lag=LAG)


@pytest.fixture(scope="module")
def result(experiment, late):
    return achieved(experiment, late, "T1")


def test_planted_amplitude_and_lag_are_found(result):
    """Within five standard errors on each axis (2e-6 that one of the six is beyond), which are below 0.1 % and 0.1 ms."""
    f = result.followed
    assert (np.abs(f.gain - GAIN) < 5 * f.gain_standard_error + 1e-5).all()
    assert (np.abs(f.lag - LAG) < 5 * f.lag_standard_error + 1e-6).all()
    assert f.gain_standard_error.max() < 1e-3
    assert f.lag_standard_error.max() < 1e-4
    assert f.common_lag == pytest.approx(LAG, abs=2e-5)
    assert any("93.0 % of the planned amplitude" in text for text in result.warnings)


def test_a_smaller_amplitude_tells_less(result):
    """The load cell's noise dominates, and what it does goes with one over the amplitude."""
    ratio = result.three_sigma / result.planned_three_sigma
    assert ((ratio > 1.04) & (ratio < 1.001 / GAIN)).all()
    assert set(result.sources) == {
        "F_precision",
        "F_bias",
        "M_precision",
        "M_bias",
        "r_cg",
        "omega_precision",
        "omega_bias",
    }


def test_without_errors_the_plan_is_what_was_run(experiment, tmp_path):
    result = achieved(experiment, ran(experiment, tmp_path / "run.mcap", quiet=True), "T1")
    np.testing.assert_allclose(result.followed.gain, 1, atol=1e-6)
    np.testing.assert_allclose(result.followed.lag, 0, atol=1e-7)
    np.testing.assert_allclose(result.three_sigma, result.planned_three_sigma, rtol=2e-3)
    assert result.stillness.acceleration < 1e-4
    assert not result.warnings


def test_a_moving_centre_of_gravity_is_seen(experiment, tmp_path):
    """It turns on an arm of 4 mm: its acceleration is alpha × r + omega × (omega × r), written out."""
    arm = np.array([0.004, 0.0, 0.0])
    path = ran(experiment, tmp_path / "run.mcap", quiet=True, r_cg_from_omb=arm)
    stillness = achieved(experiment, path, "T1").stillness
    spec = experiment.trajectories["T1"]
    t = jnp.arange(0, SECONDS, 1 / RATE)
    omega, alpha = (np.asarray(jax.jit(jax.vmap(f))(t)) for f in (spec.trajectory.omega, spec.trajectory.alpha))
    expected = np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
    rms = np.sqrt(np.mean(np.sum(expected**2, axis=1)))
    assert stillness.by == "accelerometer"
    assert stillness.acceleration == pytest.approx(rms, rel=0.03)
    assert stillness.apart == pytest.approx(rms, rel=0.03)
    assert stillness.planned == pytest.approx(0.0, abs=1e-9)
    assert stillness.displacement == pytest.approx(rms / (4 / 0.425) ** 2, rel=0.1)
    assert 4 / 0.425 / (2 * np.pi) > SLOWEST


def test_a_sampled_rotation_is_its_spline(preset):
    """A sine of 1 Hz from 40 samples a period: the spline's error is of (ωh)⁴ and (ωh)³."""
    from scipy.interpolate import CubicSpline

    at = np.arange(81) / 40
    values = np.sin(2 * np.pi * np.multiply.outer(at, np.ones(3)) + np.arange(3))
    made = MeasuredRotation(
        CubicSpline(at, values).c, np.array(1 / 40), np.array(2.0), np.array(0.1), preset.trajectories["T1"].trajectory
    )
    t = jnp.linspace(0.3, 1.7, 57)
    phase = 2 * np.pi * np.asarray(t)[:, None] + np.arange(3)
    np.testing.assert_allclose(jax.jit(jax.vmap(made.omega))(t), np.sin(phase), atol=1e-5)
    np.testing.assert_allclose(jax.jit(jax.vmap(made.alpha))(t), 2 * np.pi * np.cos(phase), atol=3e-3)


def test_another_motion_is_refused(experiment, late):
    with pytest.raises(RunError, match="is not like the plan's"):
        follow(load_run(late), experiment.trajectories["T3"])


def test_the_command_writes_what_it_says(experiment, late, tmp_path, capsys):
    (tmp_path / "e.toml").write_text(toml_text(experiment.document))
    command = ["design", str(tmp_path / "e.toml"), "--achieved", str(late), "--trajectory", "T1"]
    assert main([*command, "--out", str(tmp_path / "out")]) == 0
    assert "average 3σ of what was run" in capsys.readouterr().out
    content = json.loads((tmp_path / "out" / "achieved.json").read_text())
    assert content["followed"]["gain"] == pytest.approx([GAIN] * 3, abs=2e-3)
    assert content["provenance"]["inputs"][0]["file"] == str(late)
    assert "How each axis followed" in (tmp_path / "out" / "report.html").read_text()


def test_an_estimator_without_a_band(experiment, late, preset):
    with pytest.raises(ExperimentError, match="estimator 'central' has no band"):
        achieved(dataclasses.replace(experiment, estimators=preset.estimators), late, "T1", estimator="central")
