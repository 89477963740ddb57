"""Errors that are the same in every trial: nothing of them is drawn, and their signals have no random error.

Rounding to a step is one. The law takes it for white noise only where noise, or the motion itself, spreads its signal
over the steps. A signal that nothing random acts on is rounded in every trial alike: the estimate's error by that is
computed once, from the samples, and is a mean error without a dispersion.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from uq.analysis.propagation.prepared_run import PreparedRun
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.monte_carlo.campaign.trial_setup import setting_of
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.trials.chooser import estimates_without_draws
from uq.sources.source import Source, disturbs


def without_undrawn(case: Case, sources: Sequence[Source]) -> tuple[Case, frozenset[str]]:
    """Return a case without the sources whose errors are the same in each of its trials, and the names of these."""
    acting = [source for source in sources if source.name in case.sources]
    steps = [s for s in acting if not s.drawn and s.white_variance(1.0) is not None]
    same = frozenset(s.name for s in steps if not any(disturbs(other, s) for other in acting))
    return case._replace(sources=case.sources - same), same


def undrawn_errors(
    experiment: Experiment, spec: TrajectorySpec, estimators: Sequence[str], run: PreparedRun,
    sets: Collection[frozenset[str]],
) -> Mapping[frozenset[str], Float[np.ndarray, "estimators 6"]]:  # fmt: skip
    """Return the errors of a run's estimates by sets of such sources [kg·m²].

    Args:
        experiment: with the sources.
        spec: the trajectory.
        estimators: their names.
        run: its sums, which keep the errors.
        sets: of names of sources; an empty one adds nothing.
    """
    none = frozenset[str]()
    cases = [Case(str(number), names) for number, names in enumerate(sorted({*sets, none}, key=sorted))]
    acting = [s for s in experiment.sources if any(s.name in case.sources for case in cases)]
    if not acting:
        return {none: np.zeros((len(estimators), 6))}
    steps = tuple((s.name, *(np.asarray(x).tobytes() for x in s.settings.values())) for s in acting)

    def computed() -> dict[frozenset[str], np.ndarray]:
        chosen = [experiment.estimator(name) for name in estimators]
        setting = setting_of(replace(experiment, sources=tuple(acting), mixing=()), spec, chosen)
        estimates = np.asarray(estimates_without_draws(setting, cases))
        return {case.sources: estimates[:, k] - estimates[:, 0] for k, case in enumerate(cases)}

    return run.kept.get(("undrawn", steps, tuple(cases)), computed)
