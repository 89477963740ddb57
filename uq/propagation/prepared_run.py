"""Sums of a run for the law of propagation, kept while a person changes figures.

Sums over the samples depend on the motion, body, platform and estimators alone; expansions of the estimate, besides, on
the errors' expectations and the gyro's noise. Both are kept, so that another figure of any other source costs a few
products of small matrices. Arrays are NumPy's.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from uq.campaign.trial_setup import fitted_estimators, platform_of
from uq.experiment.experiment import Experiment, TrajectorySpec, samples
from uq.gram_sums import gram_moments
from uq.gram_sums.error_maps import Columns
from uq.gram_sums.gram_moments import products_of_estimator
from uq.gram_sums.setup import Estimator
from uq.propagation.beyond_the_law import Peaks
from uq.propagation.expansion import Expansion, Point, RunSums, expand_at, to_equations, unravel
from uq.propagation.run_sums import run_sums
from uq.sources.constant_errors import perturbed

MOST_RUNS = 32
"""Most runs whose sums are kept."""
MOST_EXPANSIONS = 128
"""Most expansions that are kept of each run."""


class Scatter(NamedTuple):
    """Effect of omega's white noise on sums and normal equations; the estimators are the first axis."""

    mean: Float[Array | np.ndarray, "*estimators products"]
    noise_free: Float[Array | np.ndarray, "*estimators products"]
    covariance: Float[Array | np.ndarray, "*estimators 27 27"]
    linear: Float[Array | np.ndarray, "*estimators 27 27"]
    """Covariance of the normal equations from the terms that are linear in the noise."""
    change: Float[Array | np.ndarray, "*estimators 27"]
    """Second-order change of the normal equations' mean about the noise-free run."""


@dataclass(frozen=True)
class PreparedRun:
    """Sums over one run, and the expansions made of them so far."""

    sums: RunSums
    peaks: Peaks
    kept: "Recent" = field(default_factory=lambda: Recent(MOST_EXPANSIONS), repr=False, compare=False)

    def expansion(self, expected: np.ndarray, variance: np.ndarray, errors: Float[np.ndarray, "e d"]) -> Expansion:
        """Return every estimator's expansion, the estimators on the first axis.

        Args:
            expected: errors, :class:`uq.sources.constant_errors.Errors` raveled.
            variance: of omega's white noise [rad²/s²].
            errors: how they follow from the d numbers that are drawn.
        """
        key = (expected.tobytes(), variance.tobytes(), errors.tobytes())

        def make():
            fields = tuple(name for name, of in unravel(np.abs(errors).sum(axis=1))._asdict().items() if np.any(of))
            return _on_host(_expansions(self.sums, Point(expected, variance), errors, fields))

        return self.kept.get(key, make)

    def scatter(self, variance: np.ndarray) -> Scatter:
        """Return what omega's white noise of this variance [rad²/s²] does to the sums."""
        return self.kept.get(variance.tobytes(), lambda: _on_host(_scatters(self.sums, variance)))

    @property
    def equations(self) -> Float[np.ndarray, "27 products"]:
        """The matrix that takes an estimator's sums to normal equations."""
        return self.kept.get("equations", lambda: np.asarray(_to_equations(self.sums.noise_free.body.r_cg_from_q)))


class Recent:
    """Values by key, the last ones used: what is typed comes back."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._values: OrderedDict[Hashable, Any] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return a key's value, which is made if it is not there; the one that was used least recently goes."""
        if key not in self._values:
            self._values[key] = make()
        self._values.move_to_end(key)
        if len(self._values) > self.most:
            self._values.popitem(last=False)
        return self._values[key]


RUNS = Recent(MOST_RUNS)


def prepared_run(experiment: Experiment, spec: TrajectorySpec, chosen: Sequence[Any]) -> PreparedRun:
    """Return a run's sums, those of an earlier call where nothing that they depend on has changed.

    Args:
        experiment: its body, platform, and which quantities its sources perturb.
        spec: the trajectory.
        chosen: specifications of the estimators.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    estimators = fitted_estimators(chosen, spec, len(samples(spec)))
    columns, delayed = Columns.of(experiment.sources), "gyro_delay" in perturbed(experiment.sources)
    parts = (
        experiment.body, platform_of(experiment, spec), (spec.trajectory, spec.duration, spec.rate), estimators,
        columns, delayed, jax.config.read("jax_enable_x64"),
    )  # fmt: skip
    return RUNS.get(_digest(parts), lambda: _summed(experiment, spec, estimators, columns, delayed))


def _digest(parts: Any) -> bytes:
    leaves, structure = jax.tree.flatten(parts)
    digest = hashlib.sha256(str(structure).encode())
    for leaf in map(np.asarray, leaves):
        digest.update(f"{leaf.dtype} {leaf.shape}".encode() + leaf.tobytes())
    return digest.digest()


def _on_host(tree: Any) -> Any:
    return jax.tree.map(np.asarray, tree)


def _summed(
    experiment: Experiment, spec: TrajectorySpec, estimators: Sequence[Estimator], columns: Columns, delayed: bool
) -> PreparedRun:
    count, taps = len(samples(spec)), [estimator.taps for estimator in estimators]
    platform = platform_of(experiment, spec)
    return PreparedRun(*run_sums(spec.trajectory, count, spec.rate, experiment.body, platform, taps, columns, delayed))


_to_equations = jax.jit(to_equations)


@partial(jax.jit, static_argnames="fields")
def _expansions(run: RunSums, point: Point, errors: Float[Array, "e d"], fields: tuple[str, ...]) -> Expansion:
    return jax.lax.map(lambda k: expand_at(run, k, point, errors, fields), jnp.arange(len(run.moments.alphas)))


@jax.jit
def _scatters(run: RunSums, variance: Float[Array, "3"]) -> Scatter:
    moments, equations = run.moments, to_equations(run.noise_free.body.r_cg_from_q)
    count = len(moments.alphas)
    places = np.array([products_of_estimator(count, k) for k in range(count)])
    nothing = jnp.zeros((len(equations), len(moments.sums)))
    rows = jax.vmap(lambda of_estimator: nothing.at[:, of_estimator].set(equations))(places)
    return Scatter(
        gram_moments.mean(moments, variance)[places],
        moments.sums[places],
        gram_moments.covariance(moments, variance, rows),
        gram_moments.first_order_covariance(moments, variance, rows),
        rows @ gram_moments.second_order_change(moments, variance),
    )
