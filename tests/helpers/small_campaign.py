"""A small campaign with the preset's sources on short trajectories, for tests of figures and reports."""

import copy
import tomllib
from functools import cache
from importlib import resources

from uq.experiment.experiment import Experiment
from uq.monte_carlo.barreto2016 import PaperResult
from uq.monte_carlo.campaign.campaign import montecarlo


def document():
    """Return the preset's content with trajectories of 12 s."""
    text = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
    changed = copy.deepcopy(tomllib.loads(text))
    for trajectory in changed["trajectory"].values():
        trajectory |= {"duration": "12 s", "ramp": "1.8 s"}
    return changed


TRIALS = 200
"""On sums, campaigns of as many trials with the preset's sources and estimators are one compiled program, of any motion."""


@cache
def campaign(trajectories=None, *, trials=TRIALS):
    """Return a campaign on the short preset."""
    return montecarlo(Experiment.from_dict(document()), trials=trials, trajectories=trajectories)


def paper_result():
    """Return the campaign as a reproduction of the paper's experiment."""
    return PaperResult(campaign())
