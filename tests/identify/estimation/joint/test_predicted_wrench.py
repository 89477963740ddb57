"""The joint model and its derivatives in closed form, against the same model in JAX and ``jax.jacfwd``."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimation.joint.joint_model import BY_ACT, COUNT, SLICES, Model
from identify.estimation.joint.predicted_wrench import PredictedWrench
from identify.signals.band_limited_run import in_band
from tests.helpers import joint_oracle
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import run_of

UNKNOWNS = {
    "inertia": [0.38, 0.004, -0.006, 0.02, 0.002, 0.384], "mass": [19.7], "r_cg": [0.004, -0.003, 0.053],
    "cg_from_still": [0.01, -0.02, 0.11], "delay": [13e-3], "rotation": [3e-2, -2e-1, 5e-2], "tilt": [0.1, -0.2],
    "gyro_scale": [0.1, -0.2, 0.1], "gyro_bias": [4e-3, -3e-3, 2e-3], "gyro_drift": [1e-3, 2e-3, -1e-3],
    "wander": np.linspace(-1e-2, 1e-2, 9), "gravity": [0.02], "accelerometer_bias": [0.1, -0.2, 0.05],
    "force_offset": [1.0, 2.0, 3.0], "moment_offset": [0.1, 0.2, 0.3], "force_drift": [0.5, 0.0, -0.5],
    "moment_drift": [0.0, 0.1, 0.0], "cell_matrix": 1e-3 * np.arange(36.0),
}  # fmt: skip
THETA = np.zeros(COUNT)
for name, value in UNKNOWNS.items():
    THETA[SLICES[name]] = value


@pytest.fixture(scope="module", autouse=True)
def loose_ranks():
    """The oracle is written as NumPy is."""
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
        yield


@pytest.fixture(scope="module", params=["still", "accelerometer", "none"])
def prediction(request):
    """A run of 8 s whose middle does not count, the unknowns far from zero."""
    rows = in_band(run_of(measure(0, seconds=8.0)), 3.0, reach=0.02, accelerometer=True)
    used = np.abs(np.arange(len(rows.t)) - len(rows.t) / 2) > 10
    up, position = np.array([0.1, -0.2, 0.97]), np.array([0.02, 0.03, -0.04])
    model = Model(
        rows=rows, up=up / np.linalg.norm(up), gravity=9.81, imu_position=position, specific_force=request.param,
        used=used,
    )  # fmt: skip
    theta = THETA.copy()
    if request.param == "none":  # whose columns leave out what the matrix does to the measured force
        theta[SLICES["cell_matrix"]] = 0
    return PredictedWrench(model, theta)


def oracle(prediction, change=lambda function: function):
    """The residuals of the rows that count, or their derivatives by every unknown."""
    residuals = jax.jit(change(partial(joint_oracle.residuals, prediction.model)))
    return np.asarray(residuals(jnp.asarray(prediction.theta)))[prediction.model.used]


def test_the_residuals_are_the_oracles(prediction):
    expected = oracle(prediction)
    counted = prediction.counted(prediction.residuals[:, :, None])[:, :, 0]
    np.testing.assert_allclose(counted, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    "prediction",
    ["accelerometer", *(pytest.param(way, marks=pytest.mark.slow) for way in ("still", "none"))],
    indirect=True,
)  # of the others by differences: runs/identification/test_error_models.py
def test_the_columns_are_its_derivatives(prediction):
    """But for the attitude's change, an integral whose quadrature is not the attitude's own."""
    model, derivatives = prediction.model, oracle(prediction, jax.jacfwd)
    for unknown, where in SLICES.items():
        if unknown in BY_ACT:  # whose columns are those of their act
            continue
        columns = prediction.counted(prediction.derivative(unknown))
        expected = -derivatives[:, :, where]
        integrated = unknown in ("gyro_scale", "gyro_bias", "gyro_drift", "wander") and model.specific_force == "still"
        within = (2e-5 if integrated else 1e-9) * max(np.abs(expected).max(), 1e-3)
        np.testing.assert_allclose(columns, expected, rtol=0, atol=within, err_msg=unknown)
