"""The preset on a platform of six legs."""

from uq.experiment.experiment import Experiment

PLATFORM = {"gravity": "9.81 m/s^2", "r_cg_from_omb": ["0 m", "0 m", "0.11 m"], "geometry": "assumed-source-size"}


def on_a_platform(preset, limits, **changes):
    """The preset on six legs, T1 shortened to 20 s with two precessions."""
    t1 = preset.document["trajectory"]["T1"] | {"duration": "20 s", "ramp": "3 s", "precessions": 2}
    document = preset.document | {"platform": PLATFORM | {"limits": limits}, "trajectory": {"T1": t1}}
    return Experiment.from_dict(document | changes)
