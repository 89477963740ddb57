"""Experiments whose best trajectory is compared with T1, and their Monte Carlo."""

import dataclasses

import numpy as np

from benchmarks.studies.design_bounds import bound_by_squares, repeating_bound
from identify.signals.estimator_spec import EstimatorSpec
from uq import montecarlo
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.hexapod.design_bound import design_bound
from uq.plan.motion_design.hexapod.rig_limits import efforts

CASES = ("preset", "near-cubic body", "linuxcnc-genhexkins", "gyro ten times noisier")
CUBIC = {
    "mass": "21 kg",
    "r_cg_from_q": ["0 mm", "0 mm", "80 mm"],
    "inertia": {"I11": "118 g*m^2", "I22": "125 g*m^2", "I33": "121 g*m^2"},
}
"""A block of steel with 140 mm edges, not quite a cube."""


def case(name: str) -> Experiment:
    """The preset's experiment on six legs that can do what T1 needs, at up to 5 Hz; changed as the name says."""
    preset = Experiment.load("barreto2016").document
    geometry = name if name == "linuxcnc-genhexkins" else "assumed-source-size"
    limits = {"needs_of": "T1", "bandwidth": "5 Hz"}
    document = preset | {"platform": preset["platform"] | {"geometry": geometry, "limits": limits}}
    if name == "near-cubic body":
        document["body"] = CUBIC
    if name == "gyro ten times noisier":
        document["source"] = [louder(source) for source in document["source"]]
    return Experiment.from_dict(document)


def louder(source):
    """A gyro's source with ten times its standard deviation."""
    if source["target"] != "omega":
        return source
    return source | {"sigma": [f"{10 * float(one.split()[0])} rad/s" for one in source["sigma"]]}


OPTIONS = {"starts": 1, "objective": "3sigma"}
"""Of every search."""


def as_it_fluctuates(found):
    """The bound for legs that fluctuate as much as the designed motion's, and that fluctuation by the limit's square."""
    squares = (efforts(found.experiment, found.spec, 80.0).legs.acceleration ** 2).mean(axis=0)
    least = design_bound(found.experiment, found.spec, found.limits, squares)
    return np.array([least.moments, least.products]), squares / found.limits.acceleration**2


def average(expanded):
    """Average 3σ of moments and of products [kg·m²]."""
    return np.array([expanded[[0, 3, 5]].mean(), expanded[[1, 2, 4]].mean()])


def bounds(found):
    """Average 3σ of moments and products [kg·m²] that cannot be beaten: repeating motions, and all by squares."""
    sharper = (
        repeating_bound(found.experiment, found.spec, found.limits),
        bound_by_squares(found.experiment, found.reference.spec, found.limits),
    )
    return [np.array([bound.moments, bound.products]) for bound in sharper if bound is not None]


def table(name, found):
    """One row: T1 at its best, the design [g·m²], and by how much it and the bounds are less, in per cent."""
    t1, ours = average(found.reference.expanded), average(found.expanded)
    figures = np.concatenate([1e3 * t1, 1e3 * ours, *(100 * (1 - least / t1) for least in (ours, *bounds(found)))])
    return f"| {name} | " + " | ".join(f"{one:.3g}" for one in figures) + " |"


def certified(found, trials):
    """Predicted and simulated 3σ of each component, for the design and for its reference, differentiators matched."""
    for spec, promised in ((found.spec, found.expanded), (found.reference.spec, found.reference.expanded)):
        matched = EstimatorSpec("matched", "savitzky-golay", spec.trajectory.highest_frequency)
        experiment = dataclasses.replace(found.experiment, trajectories={"one": spec}, estimators=(matched,))
        errors = montecarlo(experiment, trials=trials).total_errors("one", "matched")
        yield promised, 3 * np.std(errors, axis=0, ddof=1)
