"""Sums of a run for the law of propagation, kept while a person changes figures.

Sums over the samples depend on the motion, body, platform and estimators alone; expansions of the estimate, besides, on
the errors' expectations and the gyro's noise. Both are kept, so that another figure of any other source costs a few
products of small matrices. Arrays are NumPy's.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import Body
from uq.analysis.propagation.expansion import Expansion, error_maps, expand, map_series, mapped_sums
from uq.analysis.propagation.trajectory_sums import run_sums
from uq.analysis.propagation.uncovered_sources import Peaks
from uq.experiment.experiment import Experiment, TrajectorySpec, samples
from uq.monte_carlo.campaign.trial_setup import fitted_estimators, platform_of
from uq.monte_carlo.gram_sums.case_equations import NO_NOISE
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis
from uq.monte_carlo.gram_sums.noise_moments import RunMoments
from uq.monte_carlo.gram_sums.packed_equations import (
    cell_scatter,
    equations_of_products,
    expected_by_axes,
    packed_equations,
)
from uq.monte_carlo.gram_sums.run_sums import FeatureSums, RunSums
from uq.sources.constant_errors import no_errors, perturbed, unravel
from uq.sources.noise_filters import GyroNoise

MOST_RUNS = 32
"""Most runs whose sums are kept."""
MOST_EXPANSIONS = 128
"""Most expansions that are kept of each run."""


Parts = TypeVar("Parts", bound=tuple[np.ndarray, ...])


class Scatter(NamedTuple):
    """Effect of omega's white noise on sums and normal equations; the estimators are the first axis."""

    mean: Float[np.ndarray, "*estimators 6 21"]
    """Expected sums of the regressor's rows, pair by pair of axes."""
    noise_free: Float[np.ndarray, "*estimators 6 21"]
    covariance: Float[np.ndarray, "*estimators 27 27"]
    linear: Float[np.ndarray, "*estimators 27 27"]
    """Covariance of the normal equations from the terms that are linear in the noise."""
    change: Float[np.ndarray, "*estimators 27"]
    """Second-order change of the normal equations' mean about the noise-free run."""


@dataclass(frozen=True)
class PreparedRun:
    """Sums over one run, and the expansions made of them so far."""

    body: Body
    platform: Platform
    basis: WrenchBasis
    sums: RunSums
    """Sums of every estimator, without noise."""
    moments: RunMoments
    peaks: Peaks
    """Largest values and steps of the signals."""
    kept: "Recent" = field(default_factory=lambda: Recent(MOST_EXPANSIONS), repr=False, compare=False)

    def expansion(self, expected: np.ndarray, variance: np.ndarray, errors: Float[np.ndarray, "e d"]) -> Expansion:
        """Return every estimator's expansion, the estimators on the first axis.

        Args:
            expected: errors, :class:`uq.sources.constant_errors.Errors` raveled.
            variance: of omega's white noise [rad²/s²].
            errors: how they follow from the d numbers that are drawn.
        """
        key = (expected.tobytes(), variance.tobytes(), errors.tobytes())
        return self.kept.get(key, lambda: self._expanded(expected, GyroNoise.white(np.diag(variance)), errors))

    def _expanded(self, expected: np.ndarray, noise: GyroNoise, errors: np.ndarray) -> Expansion:
        fields = tuple(name for name, rows in unravel(np.abs(errors).sum(axis=1))._asdict().items() if np.any(rows))
        maps = jax.tree.map(np.asarray, map_series(self.body, self.platform, self.basis, expected, errors, fields))
        expectation = self.moments.expectation
        return stacked([expand(maps, self.sums.of_estimator(k), expectation(noise, k)) for k in self._estimators])

    @property
    def _estimators(self) -> range:
        return range(self.sums.gram.shape[1])

    def scatter(self, variance: np.ndarray) -> Scatter:
        """Return what omega's white noise of this variance [rad²/s²] does to the sums."""
        return self.kept.get(variance.tobytes(), lambda: self._scattered(GyroNoise.white(np.diag(variance))))

    def _scattered(self, noise: GyroNoise) -> Scatter:
        moments, undelayed = self.moments, self.sums.at(0.0)
        covariance, linear = moments.covariance(noise), moments.linear_covariance(noise)
        maps = error_maps(self.body, self.platform, self.basis, no_errors())

        def scatter(k: int) -> Scatter:
            gram, moment = mapped_sums(maps, FeatureSums(undelayed.gram[k], undelayed.wrench[k]))
            rows = equations_of_products(moments.algebra, k, np.asarray(self.body.r_cg_from_q))
            noisy, quiet = moments.expectation(noise, k, fourth_order=False), NO_NOISE
            return Scatter(
                mean=expected_by_axes(gram, moments.expectation(noise, k)), noise_free=expected_by_axes(gram, quiet),
                # the equations are linear in the sums: their covariance is a congruence of the sums'
                covariance=rows @ covariance @ rows.T, linear=rows @ linear @ rows.T,
                change=packed_equations(gram, moment, noisy) - packed_equations(gram, moment, quiet),
            )  # fmt: skip

        return stacked([scatter(k) for k in self._estimators])

    def cell_scatter(self, by_axes: np.ndarray, cell: np.ndarray) -> np.ndarray:
        """Return the covariance of the normal equations under the load cell's noise; see :func:`cell_scatter`."""
        return cell_scatter(by_axes, cell, np.asarray(self.body.r_cg_from_q))


def stacked(parts: Sequence[Parts], axis: int = 0) -> Parts:
    """Return one tuple of arrays from several of its kind, stacked along an axis."""
    return type(parts[0])(*(np.stack(leaves, axis=axis) for leaves in zip(*parts, strict=True)))


class Recent:
    """Cache of the values that were used last: a person who changes figures often comes back to one."""

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
    count, platform = len(samples(spec)), platform_of(experiment, spec)
    estimators = fitted_estimators(chosen, spec, count)
    basis, delayed = WrenchBasis.for_sources(experiment.sources), "gyro_delay" in perturbed(experiment.sources)
    parts = (
        experiment.body, platform, (spec.trajectory, spec.duration, spec.rate), estimators, basis, delayed,
        jax.config.read("jax_enable_x64"),
    )  # fmt: skip

    def summed() -> PreparedRun:
        body = jax.tree.map(np.asarray, experiment.body)
        sums, moments, peaks = run_sums(
            trajectory=spec.trajectory, count=count, rate=spec.rate, body=body, platform=platform, basis=basis,
            taps=[estimator.taps for estimator in estimators], delayed=delayed,
        )  # fmt: skip
        return PreparedRun(body=body, platform=platform, basis=basis, sums=sums, moments=moments, peaks=peaks)

    return RUNS.get(_digest(parts), summed)


def _digest(parts: Any) -> bytes:
    leaves, structure = jax.tree.flatten(parts)
    digest = hashlib.sha256(str(structure).encode())
    for leaf in map(np.asarray, leaves):
        digest.update(f"{leaf.dtype} {leaf.shape}".encode() + leaf.tobytes())
    return digest.digest()
