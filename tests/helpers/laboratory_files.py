"""What tests/helpers/laboratory.py measured, as ``uq`` takes it: a file and its experiment."""

import numpy as np

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from tests.helpers.laboratory import FULL_SCALE, NOISE, SIGMA, Measured
from tests.helpers.laboratory_mechanics import GRAVITY
from tests.helpers.laboratory_runs import BAND
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files

START = 1_700_000_000_000_000_000


def write(path, measured: Measured):
    """The run as an MCAP file."""
    stamps = [START + np.round(1e9 * t).astype(np.int64) for t in (measured.t_wrench, measured.t_imu)]
    wrench = WrenchChannel("/wrench", "cell", stamps[0], stamps[0], measured.force, measured.moment)
    imu = ImuChannel("/imu", "imu", stamps[1], stamps[1], measured.omega, measured.acceleration)
    runs.write(path, wrench=wrench, imu=imu, overwrite=True, compression="none")
    return path


def document(measured: Measured, method="source", sources=(), **recording):
    """The experiment file's content: what the laboratory's people know and say.

    Args:
        measured: the run.
        method: the estimator.
        sources: further tables ``[[source]]``, such as :func:`source` makes; one of a name that is there takes its place.
        recording: further keys of ``[recording]``.
    """
    usual = [
        source("F_noise", "F", "precision", [NOISE["force"]] * 3),
        source("M_noise", "M", "precision", [NOISE["moment"]] * 3),
        source("gyro_noise", "omega", "precision", [NOISE["gyro"]] * 3),
        source("F_zero", "F", "bias", SIGMA["force"]),
        source("M_zero", "M", "bias", SIGMA["moment"]),
        source("gyro_zero", "omega", "bias", SIGMA["gyro"]),
        source("r_cg", "r_cg", "bias", SIGMA["r_cg"]),
    ]
    still = {"cg_motion": "still"} if measured.declared_still else {}
    return {
        "body": {"mass": f"{measured.mass} kg", "r_cg_from_q": quantities(measured.r_cg, "m")},
        "platform": {"gravity": f"{GRAVITY} m/s^2"},
        "estimator": [{"name": "smoothed", "differentiator": "savitzky-golay", "band": f"{BAND} Hz"}],
        "source": list({table["name"]: table for table in (*usual, *sources)}.values()),
        "recording": {
            "wrench": "on_body",
            "method": method,
            "imu_position": quantities(measured.setup.imu_position, "m"),
            "sigma_gyro_bias": quantities(SIGMA["gyro"], "rad/s"),
            "sigma_accelerometer_bias": quantities(SIGMA["accelerometer"], "m/s^2"),
            **still,
            **recording,
        },
    }


UNITS = {"F": "N", "M": "N*m", "omega": "rad/s", "r_cg": "m", "r_cg_from_omb": "m", "tilt": "rad"}


def source(name, target, kind, sigma):
    """A table ``[[source]]``: three axes, a delay of one number, cross-talk in parts of full scale; a drift per second."""
    group = "load_cell" if target in ("F", "M", "wrench") else "imu" if target == "omega" else "rig"
    table = {"name": name, "target": target, "kind": kind, "group": group}
    if kind == "cross_talk":
        unit = ["N"] * 3 + ["N*m"] * 3
        full_scale = [f"{value} {name}" for value, name in zip(FULL_SCALE, unit, strict=True)]
        return table | {"datasheet": f"±{100 * sigma!r} % FS, k = 1", "full_scale": full_scale}
    if kind == "delay":
        return table | {"sigma": f"{sigma!r} s"}
    si = UNITS.get(target)
    unit = {"scale": "%", "misalignment": "rad", "drift": f"{si}/s"}.get(kind, si)
    return table | {"sigma": quantities(sigma, unit)}


def quantities(values, unit):
    return [f"{float(value)!r} {unit}" for value in values]


def identified_files(measured, folder, method="source", sources=(), recording=None, **options):
    """The tensor by files: each run an MCAP in the folder, the experiment that of the first run."""
    several = measured if isinstance(measured, (list, tuple)) else [measured]
    paths = [write(folder / f"run{k}.mcap", measured) for k, measured in enumerate(several)]
    experiment = Experiment.from_dict(document(several[0], method, sources, **(recording or {})))
    return identify_files(paths, experiment, **options)
