"""One tensor from several runs: their normal equations added; their predicted and measured scatter (type A).

A run repeats its mounting's tensor, and a mounting the body's: ``y_ij = i + a_i + b_ij + e_ij`` with the residuals'
noise ``e`` known from within each run, ``b`` from run to run and ``a`` from mounting to mounting. The pooled estimate
is the runs' weighted least squares; its scatter is taken between the outermost things that were repeated (mountings,
else runs) by their scores, ``V = K/(K-1) N⁻¹ Σ_i g_i g_iᵀ N⁻¹`` with ``K - 1`` degrees of freedom: for equal runs
this is the variance of the mountings' means over K. Errors that all runs share leave no scatter; they are type B.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.run_information import Excitation, Information, excitation
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.inertial_parameters import by_component
from identify.signals.run import RunError

NORMAL = 1.959963984540054
"""Coverage factor of 95 % of a normal distribution."""
PROBABILITY = 0.975
"""Probability below the upper end of a two-sided interval of 95 %."""
LEAST_EXCESS = 2.0
"""Scatter between runs or mountings, over what is predicted, that is worth a warning."""
RUNS_SCATTER = "the runs scatter"
"""Beginning of the sentence on runs that do."""
BEYOND_CHANCE = 0.001
"""Chance of as large a scatter below which it is beyond chance, over all components (Bonferroni)."""


def scatter_warning(ratio: float, mountings: int, where: str = "") -> str:
    """Return the sentence on runs, or mountings, that scatter more than is predicted.

    Args:
        ratio: of the scatter to what is predicted.
        mountings: how many the runs name.
        where: the components.
    """
    if mountings > 1:
        cure = "declare what changes with each mounting as a source, and list it in drawn_by_mounting"
        return f"the mountings scatter {ratio:.1f} times more than noise and sources explain{where}: {cure}"
    cure = "find out what changed; if the body was taken off in between, name the mountings"
    return f"{RUNS_SCATTER} {ratio:.1f} times more than their own noise explains{where}: {cure}"


LEAST_FREEDOM = 0.2
"""Least degrees of freedom that a coverage factor is traced back to; below, the factor exceeds 1e6."""


def student_freedom(factor: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the degrees of freedom of which Student's t has these coverage factors of 95 %; infinity for 1.96."""
    student = factor > NORMAL * (1 + 1e-4)
    freedom = scipy.special.stdtridf(PROBABILITY, np.where(student & np.isfinite(factor), factor, 2.0))
    return np.where(student & np.isfinite(factor), np.maximum(freedom, LEAST_FREEDOM), np.inf)


@dataclass(frozen=True)
class Pooling:
    """Type A evaluation (GUM 4.2) of a pooled tensor: residuals and scatter. SI units."""

    runs: int
    mountings: int
    """Number of different mountings that the runs name; 0: they name none."""
    from_residuals: Float[np.ndarray, "6 6"]
    """Covariance of the pooled tensor that the residuals alone predict [(kg·m²)²]."""
    residual_degrees_of_freedom: Float[np.ndarray, "6"]
    """Degrees of freedom of ``from_residuals``, by component."""
    from_scatter: Float[np.ndarray, "6"] | None
    """Standard uncertainty that the scatter between mountings, else runs, shows; None: there is one only [kg·m²]."""
    predicted: Float[np.ndarray, "6"]
    """Standard uncertainty of one run that its residuals predict, root mean square over the runs [kg·m²]."""
    between_runs: Float[np.ndarray, "6"] | None
    """Standard deviation of single runs' tensors (of one mounting); None: none is repeated [kg·m²]."""
    between_mountings: Float[np.ndarray, "6"] | None
    """Standard deviation of the mountings' mean tensors; None: fewer than two [kg·m²]."""
    repeat_degrees_of_freedom: int
    """Degrees of freedom of ``between_runs``."""
    scatter_degrees_of_freedom: int
    """Degrees of freedom of ``from_scatter``: one less than the mountings, or runs, that were repeated."""
    from_redrawn_sources: Float[np.ndarray, "6"]
    """Standard uncertainty of the pooled tensor from declared sources that change from mounting to mounting [kg·m²]."""

    @property
    def predicted_standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty from residuals, and from sources that change from mounting to mounting [kg·m²]."""
        return np.sqrt(np.diag(self.from_residuals) + self.from_redrawn_sources**2)

    @property
    def scatters(self) -> np.ndarray:
        """Mask of components whose interval is that of the scatter, the wider of two that are both valid."""
        if self.from_scatter is None:
            return np.zeros(6, bool)
        predicted = (
            scipy.special.stdtrit(self.residual_degrees_of_freedom, PROBABILITY) * self.predicted_standard_uncertainty
        )
        return scipy.special.stdtrit(self.scatter_degrees_of_freedom, PROBABILITY) * self.from_scatter > predicted

    @property
    def scale(self) -> np.ndarray:
        """Scale of the t distribution of each component's type A error [kg·m²]."""
        predicted = self.predicted_standard_uncertainty
        return predicted if self.from_scatter is None else np.where(self.scatters, self.from_scatter, predicted)

    @property
    def degrees_of_freedom(self) -> np.ndarray:
        """Degrees of freedom of each component's type A error."""
        return np.where(self.scatters, float(self.scatter_degrees_of_freedom), self.residual_degrees_of_freedom)

    @property
    def half_width(self) -> np.ndarray:
        """Half the interval of 95 % from type A alone [kg·m²]."""
        return scipy.special.stdtrit(self.degrees_of_freedom, PROBABILITY) * self.scale

    @property
    def excess(self) -> np.ndarray:
        """Scatter over the predicted standard uncertainty, by component; at least 1."""
        if self.from_scatter is None:
            return np.ones(6)
        return np.maximum(self.from_scatter / np.maximum(self.predicted_standard_uncertainty, 1e-300), 1.0)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A sentence on a scatter that is beyond chance and beyond what is predicted; else none."""
        excess, freedom = self.excess, self.residual_degrees_of_freedom
        chance = scipy.special.fdtrc(self.scatter_degrees_of_freedom, freedom, excess**2) if excess.max() > 1 else 1.0
        beyond = (excess > LEAST_EXCESS) & (chance < BEYOND_CHANCE / len(excess))
        if not beyond.any():
            return ()
        names = ", ".join(name for name, scatters in zip(COMPONENTS, beyond, strict=True) if scatters)
        return (scatter_warning(float(excess[beyond].max()), self.mountings, f" in {names}"),)

    @property
    def _predicted(self) -> np.ndarray:
        return self.from_residuals + np.diag(self.from_redrawn_sources**2)

    @property
    def beyond_prediction(self) -> Float[np.ndarray, "6 k"]:
        """Changes of the tensor by independent errors that the scatter shows beyond what is predicted [kg·m²].

        They are correlated as what is predicted.
        """
        return np.sqrt(self.excess**2 - 1)[:, None] * root_of(self._predicted)

    @property
    def covariance(self) -> np.ndarray:
        """Type A covariance: of the residuals, widened on each component to what the scatter shows [(kg·m²)²]."""
        return self._predicted + self.beyond_prediction @ self.beyond_prediction.T

    @property
    def effective_degrees_of_freedom(self) -> np.ndarray:
        """Degrees of freedom of which Student's t of the standard uncertainty has the half-width; by component.

        Those of the type A error, but where few runs scatter less than is predicted and their t is the wider.
        """
        u = np.sqrt(np.diag(self.covariance))
        factor = np.divide(self.half_width, u, out=np.full(6, NORMAL), where=u > 0)
        return np.where(np.isclose(self.scale, u, rtol=1e-12), self.degrees_of_freedom, student_freedom(factor))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m²."""
        return {
            "runs": self.runs,
            "mountings": self.mountings,
            "type_a": by_component(np.sqrt(np.diag(self.covariance))),
            "degrees_of_freedom": by_component(self.degrees_of_freedom),
            "coverage_factor": by_component(self.half_width / np.maximum(np.sqrt(np.diag(self.covariance)), 1e-300)),
            "predicted_of_one_run": by_component(self.predicted),
            "between_runs": None if self.between_runs is None else by_component(self.between_runs),
            "between_runs_degrees_of_freedom": self.repeat_degrees_of_freedom,
            "between_mountings": None if self.between_mountings is None else by_component(self.between_mountings),
        }


@dataclass(frozen=True)
class Repeat:
    """Data of one run for the pooling."""

    score: Float[np.ndarray, "6"]
    """``w Ωᵀ(y - Ω i)`` at the pooled tensor i, w the run's weight."""
    inertia: Float[np.ndarray, "6"]
    """Packed tensor of this run alone [kg·m²]."""
    standard_uncertainty: Float[np.ndarray, "6"]
    """Standard uncertainty of ``inertia`` from the run's residuals [kg·m²]."""
    alone: bool
    """Whether the run identifies the whole tensor by itself."""
    mounting: str | None


def pooling(
    repeats: Sequence[Repeat],
    inverse: Float[np.ndarray, "6 6"],
    from_residuals: Float[np.ndarray, "6 6"],
    residual_degrees_of_freedom: Float[np.ndarray, "6"],
) -> Pooling:
    """Return the type A evaluation of a pooled tensor.

    The interval is the wider of two: Student's by the scatter with K - 1 degrees of freedom, which covers whatever
    lies between the runs, and the one predicted from the residuals, which a scatter small by chance must not undercut.

    Args:
        repeats: the runs.
        inverse: of the weighted sum of their ``ΩᵀΩ``, zero in what the motion does not determine.
        from_residuals: covariance of the pooled tensor from the residuals.
        residual_degrees_of_freedom: of it, by component.
    """
    names = [run.mounting for run in repeats]
    labels = list(dict.fromkeys(name for name in names if name is not None))
    clusters = [[run for run in repeats if run.mounting == label] for label in labels]
    if len(clusters) < 2:
        clusters = [[run] for run in repeats]
    alone = [run for run in repeats if run.alone]
    rms = np.sqrt(np.mean([run.standard_uncertainty**2 for run in alone or repeats], axis=0))
    inside, freedom = _within(alone)
    count = sum(any(run.alone for run in cluster) for cluster in clusters)
    scatter = _scatter(clusters, inverse) if count > 1 else None
    return Pooling(
        runs=len(repeats), mountings=len(labels), from_residuals=from_residuals,
        residual_degrees_of_freedom=residual_degrees_of_freedom, from_scatter=scatter, predicted=rms,
        between_runs=inside, between_mountings=_between(alone, labels), repeat_degrees_of_freedom=freedom,
        scatter_degrees_of_freedom=count - 1, from_redrawn_sources=np.zeros(6),
    )  # fmt: skip


def _scatter(clusters: Sequence[Sequence[Repeat]], inverse: np.ndarray) -> np.ndarray:
    """Standard uncertainty of the pooled tensor from the scores of what was repeated, each cluster's summed."""
    pushes = inverse @ np.transpose([np.sum([run.score for run in c], axis=0) for c in clusters])
    return np.sqrt((pushes**2).sum(axis=1) * len(clusters) / (len(clusters) - 1))


def _within(runs: Sequence[Repeat]) -> tuple[np.ndarray | None, int]:
    """Standard deviation of single runs about their mounting's mean, and its degrees of freedom."""
    groups = [[run.inertia for run in runs if run.mounting == name] for name in {run.mounting for run in runs}]
    freedom = sum(len(group) - 1 for group in groups)
    if freedom < 1:
        return None, 0
    squares = sum(((np.array(group) - np.mean(group, axis=0)) ** 2).sum(axis=0) for group in groups)
    return np.sqrt(squares / freedom), freedom


def _between(runs: Sequence[Repeat], labels: Sequence[str]) -> np.ndarray | None:
    means = [np.mean([run.inertia for run in runs if run.mounting == name], axis=0)
             for name in labels if any(run.mounting == name for run in runs)]  # fmt: skip
    return np.std(means, axis=0, ddof=1) if len(means) > 1 else None


CLEAR = 0.01
"""Part of a component in what is not excited that counts as none."""


class Pooled(NamedTuple):
    """The estimate from several runs together. What the motion does not excite is zero in all of it."""

    inertia: np.ndarray
    """Packed tensor from all runs [kg·m²]."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain [kg·m²]."""
    covariance: np.ndarray
    """Residuals, scatter between runs, centre of gravity, (6, 6) [(kg·m²)²]."""
    residual: np.ndarray
    """Part of ``covariance`` that the residuals predict, (6, 6) [(kg·m²)²]."""
    by_centre: np.ndarray
    """Derivative of the tensor with respect to r_CG, (6, 3)."""
    by_right: np.ndarray
    """Derivative of the tensor with respect to each run's right side, (k, 6, 6)."""
    together: Pooling
    """Type A evaluation: what residuals and the scatter between runs and mountings show."""
    half_width: np.ndarray
    """Half the interval of 95 % by component [kg·m²]: type A's, and the normal one of r_CG, added in squares."""
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom by component (GUM G.4; r_CG's uncertainty counts as known)."""
    excitation: Excitation
    """Components that the motions of all runs together determine."""

    @property
    def seen(self) -> np.ndarray:
        """The directions in the space of packed tensors that it does excite, (k, 6); small parts of them left out."""
        blind = self.excitation.directions[~self.excitation.identifiable]
        clear = np.where(np.abs(blind) < CLEAR, 0.0, blind)
        return np.linalg.qr(np.concatenate([clear, np.eye(6)]).T)[0].T[len(blind) :]

    @property
    def coverage_factor(self) -> np.ndarray:
        """Coverage factor of 95 %, by component."""
        return self.half_width / np.maximum(np.sqrt(np.diag(self.covariance)), 1e-300)


def pool(estimates: Sequence[Information], sigma_r_cg: np.ndarray) -> Pooled:
    """Return the tensor of several runs, each weighted by the inverse of its noise variance.

    Args:
        estimates: what each run says.
        sigma_r_cg: standard uncertainty of the centre of gravity on each axis [m].

    Raises:
        RunError: the motion tells nothing at all.
    """
    weights = np.array([estimate.weight for estimate in estimates])
    normal = np.einsum("k,kij->ij", weights, [estimate.normal for estimate in estimates])
    noise = np.einsum("k,kij->ij", weights, [estimate.noise for estimate in estimates])
    verdict = excitation(normal, noise)
    seen = verdict.directions[verdict.identifiable]
    if not len(seen):
        first, more = estimates[0].run, len(estimates) - 1
        names = ", ".join(verdict.unidentifiable)
        raise RunError(
            f"the motion in {first.name}{f' and {more} more' if more else ''} does not identify {names}: "
            f"{first.cure('rotate about more axes, or faster')}"
        )
    inverse = seen.T @ np.diag(1 / verdict.strength[verdict.identifiable]) @ seen
    inertia = inverse @ (weights @ [estimate.right for estimate in estimates])
    by_centre = inverse @ np.einsum("k,kij->ij", weights, [estimate.right_by_centre for estimate in estimates])
    residual = inverse @ np.einsum("k,kij->ij", weights**2, [estimate.scores for estimate in estimates]) @ inverse
    freedom_of_residuals = _degrees_of_freedom(estimates, weights, inverse)
    together = pooling(_repeats(estimates, weights, inertia), inverse, residual, freedom_of_residuals)
    noise_covariance, centre_covariance = together.covariance, by_centre * sigma_r_cg**2 @ by_centre.T
    covariance = noise_covariance + centre_covariance
    half = np.hypot(together.half_width, NORMAL * np.sqrt(np.diag(centre_covariance)))
    freedom = together.degrees_of_freedom * (np.diag(covariance) / np.maximum(np.diag(noise_covariance), 1e-300)) ** 2
    bias = seen.T @ (seen @ inertia - np.linalg.solve(seen @ (normal - noise) @ seen.T, seen @ normal @ inertia))
    share = weights * [estimate.rows for estimate in estimates]
    gain_error = share @ [estimate.gain_error for estimate in estimates] / share.sum()
    return Pooled(
        inertia=inertia, bias=bias + gain_error * inertia, covariance=covariance, residual=residual,
        by_centre=by_centre, by_right=weights[:, None, None] * inverse, together=together, half_width=half,
        degrees_of_freedom=np.clip(freedom, 1, 1e9), excitation=verdict,
    )  # fmt: skip


def _repeats(estimates: Sequence[Information], weights: np.ndarray, inertia: np.ndarray) -> list[Repeat]:
    """Return the data of each run for the evaluation of scatter."""
    return [
        Repeat(
            score=weight * (estimate.right - estimate.normal @ inertia), inertia=estimate.inertia,
            standard_uncertainty=np.sqrt(np.diag(estimate.covariance)),
            alone=bool(estimate.excitation.identifiable.all()), mounting=estimate.run.mounting,
        )
        for estimate, weight in zip(estimates, weights, strict=True)
    ]  # fmt: skip


def _degrees_of_freedom(estimates: Sequence[Information], weights: np.ndarray, inverse: np.ndarray) -> np.ndarray:
    """Return effective degrees of freedom of the pooled tensor's variance from residuals, by component (GUM G.4)."""
    squares = np.array([w**2 * np.diag(inverse @ p.scores @ inverse) for w, p in zip(weights, estimates, strict=True)])
    terms = (squares**2 / [estimate.degrees_of_freedom for estimate in estimates]).sum(axis=0)
    return np.clip(squares.sum(axis=0) ** 2 / np.maximum(terms, 1e-300), 1, 1e9)
