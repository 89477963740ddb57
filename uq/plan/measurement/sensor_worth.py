"""Which sensor should I buy? What each source's size does to the answer, by derivative, and what halving it would do.

The derivative is that of ``ln 3σ`` by ``ln sigma``: 0.8 says that one per cent less of a source's sigma leaves 0.8 per
cent less of the 3σ. Where sources add in squares, the derivatives of all of them add up to one.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.display.reporting import Result
from identify.display.rounding import significant
from identify.exceptions import explains_names
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component
from uq.analysis.propagation.experiment_law import prepare_law
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.gram_sums.cases import cases_of
from uq.plan.measurement.required_duration import NOTHING, average

BOTH = ("moments", "products")
NEGLIGIBLE = 5e-4
"""Change of an average 3σ that a terminal does not show."""
STEP = 0.01
"""Part of a sigma over which derivatives are taken; the error is of its square."""


@dataclass(frozen=True, repr=False)
class SensorWorth(Result):
    """Effect of each source's size on the 3σ of one trajectory and estimator.

    Example: ``sensor_worth(Experiment.load("barreto2016")).to_frame()["derivative"].unstack()``.
    """

    unit_of_columns = "kg·m²"
    pure = frozenset({"derivative"})

    sources: tuple[str, ...]
    trajectory: str
    estimator: str
    three_sigma: Float[np.ndarray, "6"]
    """Three standard deviations of each component with all sources as they are [kg·m²]."""
    derivative: Float[np.ndarray, "sources 6"]
    """Derivative of ln 3σ by the logarithm of each source's sigma."""
    halved: Float[np.ndarray, "sources 6"]
    """3σ with this source's sigma halved [kg·m²]."""
    remarks: tuple[str, ...] = ()
    """Reasons why a smaller source makes a 3σ larger, where it does."""
    name: str = "sensors"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def by_worth(self) -> list[int]:
        """Numbers of the sources, that first whose halving lowers the sum of all six 3σ most."""
        return np.argsort(self.halved.sum(axis=1)).tolist()

    @property
    def best(self) -> str:
        """The source whose halving lowers the sum of all six 3σ most."""
        return self.sources[int(np.argmin(self.halved.sum(axis=1)))]

    def changes(self) -> Float[np.ndarray, "sources 2"]:
        """Return what halving each source's sigma changes the average 3σ of moments and of products by, in parts."""
        now, halved = ([average(w, goal) for goal in BOTH] for w in (self.three_sigma, self.halved))
        return np.stack(halved, axis=1) / np.array(now) - 1

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says: 3σ in g·m², by source and component."""
        return {
            "trajectory": self.trajectory, "estimator": self.estimator, "unit": "g*m^2",
            "three_sigma": by_component(GRAM_METRE * self.three_sigma),
            "sources": {
                name: {"derivative": by_component(d), "three_sigma_if_halved": by_component(GRAM_METRE * h)}
                for name, d, h in zip(self.sources, self.derivative, self.halved, strict=True)
            },
        }  # fmt: skip

    def records(self) -> list[dict[str, Any]]:
        """Return derivative and 3σ with half the sigma, in kg·m², by source and component."""
        return [
            {"source": source, "component": component, "derivative": self.derivative[s, k]}
            | {"three_sigma_if_halved": self.halved[s, k]}
            for s, source in enumerate(self.sources)
            for k, component in enumerate(COMPONENTS)
        ]


@explains_names
def sensor_worth(experiment: Experiment, trajectory: str | None = None, estimator: str | None = None) -> SensorWorth:
    """Return what each source's size does to the 3σ of every component, by the law of propagation.

    Args:
        experiment: body, platform, sources, estimators.
        trajectory: its name; None for the first.
        estimator: its name; None for the recording's, or the first.

    Raises:
        ExperimentError: an unknown name, no source that counts, or one that the law cannot take.
    """
    name, _ = experiment.select(trajectory)
    chosen = experiment.estimator(estimator).name
    if not experiment.sources:
        raise ExperimentError(NOTHING)
    prepared = prepare_law(experiment, name, chosen)

    def width(factor: float, number: int | None = None) -> np.ndarray:
        """3σ with the sigma of one source, or of none, times a factor."""
        sources = [s.resized(factor) if k == number else s for k, s in enumerate(experiment.sources)]
        total, *_ = cases_of(sources)
        return prepared.of_cases([total], sources)[name][chosen][0].three_sigma

    names, now = tuple(source.name for source in experiment.sources), width(1.0)
    if not now.any():
        raise ExperimentError(NOTHING)
    more, less, halved = (
        np.array([width(factor, number) for number in range(len(names))]).reshape(-1, 6)
        for factor in (1 + STEP, 1 - STEP, 0.5)
    )
    derivative = np.log(more / less) / np.log((1 + STEP) / (1 - STEP))
    worth = SensorWorth(
        sources=names, trajectory=name, estimator=chosen, three_sigma=now, derivative=derivative, halved=halved,
        provenance=experiment.inputs(),
    )  # fmt: skip
    return replace(worth, remarks=tuple(_remarks(experiment, worth)))


def _remarks(experiment: Experiment, worth: SensorWorth) -> Iterator[str]:
    """Say of each source whose halving raises an average 3σ why it does."""
    correlated = {name for mix in experiment.mixing if len(mix.names) > 1 for name in mix.names}
    for source, changes in zip(experiment.sources, worth.changes(), strict=True):
        if changes.max() < NEGLIGIBLE:
            continue
        goal = BOTH[int(np.argmax(changes))]
        raised = (
            f"half of {source.name.replace('_', ' ')} raises the {goal}' 3σ by {significant(100 * changes.max(), 2)} %"
        )
        if source.of_gyro and source.noise:
            yield f"{raised}: this noise makes every estimate smaller, and the errors of other sources with it"
        elif source.name in correlated:
            yield f"{raised}: it is correlated with a source that it cancels in part"
        else:
            yield f"{raised}: it cancels others in part, or makes the estimate smaller"
