"""Sliders for every source's figure, the duration and the amplitude, in Jupyter: 3σ and mean error redrawn at once.

What is redrawn comes from the law's numbers (:mod:`uq.analysis.propagation.adjustable_law`), in the browser: no kernel
waits.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from identify.exceptions import explains_names
from uq.analysis.propagation.experiment_law import prepare_law
from uq.experiment.experiment import Experiment
from uq.plan.measurement.adjustable_motion import explorable

if TYPE_CHECKING:
    from uq.plan.measurement.explorer import Explorer


@explains_names
def explore(
    experiment: Experiment,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
) -> "Explorer":
    """Return a widget for Jupyter that shows what each source does, and follows its figures as they are changed.

    3σ and mean error of every component, of all sources together and of each one's part, by the law of propagation.
    ``widget.experiment`` is the experiment as the sliders stand. Figures follow the law's own equations; duration and
    amplitude are interpolated between the law at a half, at one and at two, or from the shortest that the ramps allow.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all.

    Raises:
        ExperimentError: no such trajectory or estimator, nothing to estimate from, or a source beyond the law.
        ModuleNotFoundError: anywidget is not installed.
    """
    try:
        from uq.plan.measurement.explorer import Explorer
    except ModuleNotFoundError:
        raise ModuleNotFoundError("anywidget is missing for explore(): pip install 'inertia-uq[explore]'") from None
    return Explorer(experiment, explorable(prepare_law(experiment, trajectories, estimators)))
