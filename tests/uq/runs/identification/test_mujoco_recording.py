"""MuJoCo's body on a moving base, with MuJoCo's own sensors, written by rosbags, identified by the command."""

import json

import numpy as np
import pytest

from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.mujoco_rig import GRAVITY, Load, moving, write
from uq.cli.main import main

BODY = Load(19.7, (0.012, -0.008, 0.053), (0.3813, 0.004, -0.006, 0.0185, 0.002, 0.3791))
EXPERIMENT = """
[body]
r_cg_from_q = ["12 mm", "-8 mm", "53 mm"]

[[estimator]]
name = "smoothed"
differentiator = "savitzky-golay"
band = "2.2 Hz"

[recording]
wrench = "{wrench}"
"""


@pytest.fixture(scope="module")
def signals():
    return moving(BODY, noise=0.0)


@pytest.mark.parametrize(
    ("wrench", "sign"), [pytest.param("on_body", 1.0, marks=pytest.mark.slow), ("on_sensor", -1.0)]
)
@pytest.mark.usefixtures("blank_pictures")
def test_mujocos_body_is_identified(tmp_path, signals, wrench, sign, capsys):
    t, readings = signals
    # At rest MuJoCo's force sensor reads the weight upward: the force on the load.
    assert readings[:, 2].mean() == pytest.approx(BODY.mass * GRAVITY, rel=0.1)
    run = write(tmp_path / "bag", t, readings * np.r_[np.full(6, sign), np.ones(6)])
    experiment = tmp_path / "e.toml"
    experiment.write_text(EXPERIMENT.format(wrench=wrench))
    out = tmp_path / "out"
    assert main(["identify", str(next(run.glob("*.mcap"))), "--experiment", str(experiment), "--out", str(out)]) == 0
    assert "I33" in capsys.readouterr().out
    identified = json.loads((out / "result.json").read_text())["inertia"]
    moments = dict(zip(COMPONENTS, BODY.inertia, strict=True))
    for name, true in moments.items():
        scale = np.sqrt(moments[f"I{name[1]}{name[1]}"] * moments[f"I{name[2]}{name[2]}"])
        assert abs(identified[name] - true) <= 0.002 * scale, name
