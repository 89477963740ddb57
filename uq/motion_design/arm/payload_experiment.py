"""The experiment that identifies the payload from a recording of a designed joint motion: ``identify.toml``."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from uq.experiment.arm_table import DeclaredArm
from uq.experiment.experiment import Experiment
from uq.files.toml_text import toml_text
from uq.recorded.urdf_model import urdf_robot

NAME = "identify.toml"
ANYWHERE = "0.1 m"
"""Standard uncertainty of a centre of gravity that is a first guess."""


def payload_experiment(experiment: Experiment, arm: DeclaredArm) -> dict[str, bytes]:
    """Return the experiment and its URDF, whose other joints are fixed, by their names.

    By method ``joint``, from the wrench and the joints' positions: mass, centre of gravity and tensor are unknown, the
    sources of force and moment as declared. Of the sensor it says that its axes are those of ``platform.tool`` and that
    it reads what the payload does to it: ``inertia inspect`` names what is otherwise.
    """
    document: dict[str, Any] = dict(experiment.document)
    band = document["platform"]["limits"]["bandwidth"]
    urdf = Path(arm.urdf).name
    guess = {"name": "r_cg", "target": "r_cg", "kind": "bias", "sigma": [ANYWHERE] * 3, "group": "first guess"}
    content = {
        "body": {"r_cg_from_q": document["body"]["r_cg_from_q"]},
        "platform": {"gravity": f"{experiment.gravity!r} m/s^2"},
        "estimator": [{"name": "smoothed", "differentiator": "savitzky-golay", "band": band}],
        "source": [guess, *(source for source in document["source"] if source["target"] in ("F", "M", "wrench"))],
        "recording": {
            "wrench": "on_sensor",
            "wrench_rotation_to_body": "x, y, z",
            "method": "joint",
            "urdf": urdf,
            "urdf_frame": arm.tool,
            "urdf_gravity": ["0 m/s^2", "0 m/s^2", f"{-experiment.gravity!r} m/s^2"],
            "sigma_rotation": "0 deg",
            "sigma_gyro_bias": "0 rad/s",
            "sigma_accelerometer_bias": "0 m/s^2",
        },
    }
    robot = ElementTree.tostring(urdf_robot(arm.urdf, "platform.urdf", arm.fixed), "unicode")
    return {NAME: toml_text(content).encode(), urdf: robot.encode()}
