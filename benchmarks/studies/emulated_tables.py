"""``python -m benchmarks.studies.emulated_tables``: repeated runs of T1 to T4, the paper's Tables 3 and 4 in form.

The centre of gravity is determined once, before all runs: its error is one draw a repeat, which the runs of all
trajectories share. Everything else is drawn anew in each run, alike for all trajectories (common random numbers).
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from identify.display.reporting import Result
from identify.display.rounding import fixed, with_uncertainty
from identify.display.text_tables import Table
from identify.floating_point import check_precision
from identify.pytree import Pytree
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, MOMENTS, PRODUCTS
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.files.provenance import provenance
from uq.monte_carlo.campaign.trial_setup import setting_of
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.trials.samples_engine import SamplesEngine, prepare_samples, sampled_trial
from uq.monte_carlo.trials.trial_loop import all_trials
from uq.progress_bar import Progress, progress_of
from uq.sources.draws import draw_constants
from uq.sources.random_normals import Index
from uq.sources.source import Source

TABLE3: Mapping[str, Mapping[str, float]] = {
    "expected": {"I11": 382.89, "I12": 0.0, "I13": 0.0, "I22": 18.72, "I23": 0.0, "I33": 380.66},
    "mean": {"I11": 387.24, "I12": 1.19, "I13": 1.20, "I22": 18.30, "I23": -1.78, "I33": 380.99},
    "standard deviation": {"I11": 0.22, "I12": 1.79, "I13": 0.15, "I22": 0.01, "I23": 0.21, "I33": 0.48},
}
"""The paper's Table 3, five runs of T1 [g·m²]."""
TABLE4: Mapping[str, tuple[float, float]] = {
    "T1": (1.7, 1.39), "T2": (3.72, 1.6), "T3": (1.73, 1.76), "T4": (4.19, 2.05),
}  # fmt: skip
"""The paper's Table 4: average deviation of moments and of products [g·m²]."""
PAIRS = (("T1", "T2"), ("T3", "T4"))
"""Trajectories that differ in the point that keeps still: the centre of gravity, or the platform's centre."""


class Imperfections(NamedTuple):
    """Imperfections of a rig besides Table 1's noise and offsets: standard deviations of normal draws, one per run."""

    still_point: float = 1e-3
    """Standard deviation of the still point's position on each axis [m], besides the error of the centre of gravity.
    The centre of gravity has a residual acceleration of about this distance times the angular acceleration."""
    delay: float = 1e-3
    """Standard deviation of the gyro's delay against the load cell [s]."""


@dataclass(frozen=True, repr=False)
class EmulatedTables(Result):
    """Repeats of the paper's experiment, with the errors of every run.

    Example: ``emulated_tables(repeats=10).to_frame().loc["T1", "moments"]``.
    """

    runs: int
    """Runs of each trajectory in a repeat."""
    seed: int
    nominal: np.ndarray
    """True packed tensor of the body [kg·m²]."""
    errors: Mapping[str, np.ndarray]
    """Estimate minus truth by trajectory, (repeats, runs, 6) [kg·m²]."""
    imperfections: Imperfections
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def repeats(self) -> int:
        """Number of repeats of the experiment."""
        return len(next(iter(self.errors.values())))

    def average_deviation(self, trajectory: str) -> np.ndarray:
        """Return ``|mean of the runs - truth|`` averaged over the moments and over the products, (repeats, 2)."""
        off = np.abs(self.errors[trajectory].mean(axis=1))
        return np.stack([off[:, list(group)].mean(axis=1) for group in (MOMENTS, PRODUCTS)], axis=1)

    def gain(self, better: str, worse: str) -> tuple[np.ndarray, np.ndarray]:
        """Return how much smaller the average deviation of ``one`` is than that of ``other``, and its standard error.

        Moments, then products [kg·m²]; the difference is taken repeat by repeat.
        """
        difference = self.average_deviation(worse) - self.average_deviation(better)
        with np.errstate(invalid="ignore"):
            return difference.mean(axis=0), difference.std(axis=0, ddof=1) / np.sqrt(self.repeats)

    def rows3(self, repeat: int = 0, trajectory: str = "T1") -> tuple[list[str], list[list[str]]]:
        """Return head and rows of Table 3 of one repeat, beside the paper's, in g·m²."""
        estimates = self.errors[trajectory][repeat] + self.nominal
        ours = {
            "expected": self.nominal,
            "mean": estimates.mean(axis=0),
            "standard deviation": estimates.std(axis=0, ddof=1),
        }
        rows = []
        for name, values in ours.items():
            rows.append([f"{name}, emulated", *(fixed(GRAM_METRE * x, 2) for x in values)])
            rows.append([f"{name}, source", *(fixed(TABLE3[name][c], 2) for c in COMPONENTS)])
        return [f"{trajectory}, {self.runs} runs", *COMPONENTS], rows

    def rows4(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of Table 4, the mean over the repeats beside the paper's, in g·m²."""
        rows = []
        for name in self.errors:
            off = GRAM_METRE * self.average_deviation(name)
            error = off.std(axis=0, ddof=1) / np.sqrt(len(off)) if len(off) > 1 else np.full(2, np.nan)
            ours = [with_uncertainty(x, u) for x, u in zip(off.mean(axis=0), error, strict=True)]
            printed = [fixed(x, 2) for x in TABLE4.get(name, (np.nan, np.nan))]
            rows.append([name, ours[0], printed[0], ours[1], printed[1]])
        return ["average deviation", "moments", "source", "products", "source"], rows

    def gain_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the paired differences, in g·m² and in their standard errors."""
        rows = []
        for better, worse in PAIRS:
            if {better, worse} <= set(self.errors):
                for what, gain, error in zip(("moments", "products"), *self.gain(better, worse), strict=True):
                    figure = with_uncertainty(GRAM_METRE * gain, GRAM_METRE * error)
                    rows.append([f"{worse} less {better}, {what}", figure, fixed(gain / error if error else np.nan, 1)])
        return ["average deviation", "difference", "in standard errors"], rows

    def to_dict(self) -> dict[str, Any]:
        """Return every run's tensor, in g·m²."""
        return {
            "unit": "g*m^2",
            "repeats": self.repeats,
            "runs": self.runs,
            "seed": self.seed,
            "imperfections": self.imperfections._asdict(),
            "nominal": (GRAM_METRE * self.nominal).tolist(),
            "errors": {name: (GRAM_METRE * errors).tolist() for name, errors in self.errors.items()},
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def title(self) -> str:
        """Return what the tables are of."""
        return f"The paper's experiment, emulated {self.repeats} times, {self.runs} runs of each trajectory; g·m²"

    def tables(self) -> list[Table]:
        """Return Table 3 of the first repeat, Table 4, and the gain of a centre of gravity that keeps still."""
        third = [Table("", *self.rows3())] if "T1" in self.errors and self.runs > 1 else []
        gain = [Table("", *self.gain_rows())] if self.repeats > 1 else []
        return [*third, Table("", *self.rows4()), *gain]

    def records(self) -> list[dict[str, Any]]:
        """Return the average deviations of every repeat, in g·m²."""
        return [
            {"trajectory": name, "components": components, "repeat": repeat, "average_deviation": GRAM_METRE * value}
            for name in self.errors
            for repeat, row in enumerate(self.average_deviation(name))
            for components, value in zip(("moments", "products"), row, strict=True)
        ]

    def notes(self) -> list[str]:
        """Return the warnings, a line each."""
        return [f"warning: {text}" for text in self.warnings]


def emulated_tables(
    experiment: Experiment | None = None,
    *,
    repeats: int = 1,
    runs: int = 5,
    seed: int = 0,
    estimator: str = "smoothed",
    trajectories: Sequence[str] = ("T1", "T2", "T3", "T4"),
    imperfections: Imperfections = Imperfections(),  # noqa: B008
    progress: Progress | bool | None = None,
) -> EmulatedTables:
    """Emulate the paper's experiment: runs of each trajectory that share the error of the centre of gravity.

    Args:
        experiment: body, platform, trajectories, sources, estimators; None for the preset ``barreto2016``.
        repeats: how often the whole experiment is done, each with its own centre of gravity.
        runs: of each trajectory in a repeat.
        seed: of all draws.
        estimator: its name.
        trajectories: their names.
        imperfections: what the rig does besides the experiment's sources.
        progress: called with a trajectory's name, repeats done and asked for; True: a bar.

    Raises:
        ExperimentError: no repeats or runs, no such trajectory or estimator, or no source of r_cg.
    """
    experiment = Experiment.load("barreto2016") if experiment is None else experiment
    if repeats < 1 or runs < 1:
        raise ExperimentError(f"{repeats} repeats of {runs} runs: ask for one or more of each")
    warned = check_precision("float64")
    errors = {}
    tell = progress_of(progress, "repeats")
    for name in trajectories:
        rig = _prepared(experiment, name, estimator, imperfections, runs)
        report = lambda done, _, name=name: tell(name, done // runs, repeats)  # noqa: E731
        inertia = all_trials(_emulated_runs, rig, repeats * runs, seed, segment=runs, progress=report)
        errors[name] = inertia.reshape(repeats, runs, 6) - np.asarray(experiment.body.inertia)
    record = provenance(**experiment.inputs(), repeats=repeats, runs=runs, seed=seed, estimator=estimator)
    return EmulatedTables(runs, seed, np.asarray(experiment.body.inertia), errors, imperfections, tuple(warned), record)


class _Rig(Pytree):
    """One trajectory's runs, and whether its platform holds the believed centre of gravity still."""

    setup: SamplesEngine
    centre: tuple[Source, ...]
    """Sources of the believed centre of gravity, drawn once a repeat."""
    holds_cg: jax.Array
    """Whether the platform holds the believed centre of gravity still: 1 or 0."""
    runs: jax.Array
    """Runs of each trajectory in a repeat."""


def _prepared(experiment: Experiment, name: str, estimator: str, imperfections: Imperfections, runs: int) -> _Rig:
    """A trajectory with the rig's sources; those of r_cg and of the still point have a mean that each repeat sets."""
    name, spec = experiment.select(name)
    setting = setting_of(experiment, spec, [experiment.estimator(estimator)])
    setup = prepare_samples(setting._replace(sources=_sources(experiment, imperfections), mixing=()))
    together = Case("total", frozenset(source.name for source in setup.sources))
    centre = tuple(source for source in experiment.sources if source.perturbs == "r_cg")
    return _Rig(replace(setup, cases=(together,)), centre, jnp.asarray(float(spec.still == "cg")), jnp.asarray(runs))


def _sources(experiment: Experiment, imperfections: Imperfections) -> list[Source]:
    zero, still = np.zeros(3), np.full(3, imperfections.still_point)
    return [
        *(source for source in experiment.sources if source.perturbs != "r_cg"),
        Source("shared r_cg", "r_cg", "bias", "rig", zero, mean=jnp.zeros(3)),
        Source("still point", "r_cg_from_omb", "bias", "rig", still, mean=jnp.zeros(3)),
        Source("delay", "omega", "delay", "rig", np.array(imperfections.delay)),
    ]


def shared_error(centre: Sequence[Source], key: jax.Array, repeat: Index) -> jax.Array:
    """Return the error of the believed centre of gravity that all runs of a repeat share [m]."""
    return sum(draw_constants(centre, (), key, repeat, float).values(), jnp.zeros(3))


def _emulated_runs(rig: _Rig, key: jax.Array, indices: jax.Array) -> jax.Array:
    """Tensors of some runs, repeat after repeat; a platform that holds the believed centre misses the true one."""

    def of_run(index: jax.Array) -> jax.Array:
        shared = shared_error(rig.centre, key, index // rig.runs)
        means = {"shared r_cg": shared, "still point": -rig.holds_cg * shared}
        sources = (replace(s, mean=means[s.name]) if s.name in means else s for s in rig.setup.sources)
        setup = replace(rig.setup, sources=tuple(sources))
        return sampled_trial(setup, key, index)[0, 0]

    return jax.lax.map(of_run, indices)


def main() -> None:
    """Print the tables of the preset."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies.emulated_tables", description=__doc__)
    parser.add_argument("--repeats", type=int, default=400, help="repeats of the paper's experiment (400)")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(emulated_tables(repeats=options.repeats, progress=True))


if __name__ == "__main__":
    main()
