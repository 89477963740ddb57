"""The tensor, its uncertainty and what forbids a smaller one, from the sums of a run that is still being recorded.

The estimate is (10) by ordinary least squares, constant offsets estimated along. Type A comes from the residuals'
spectrum, a covariance across the axes for each band of frequency, from more lines where the bands above it agree; what
the declared sources do is drawn as ``inertia identify`` draws it, but less often. Causes that need all samples
(conventions, resonances, the admissible range, generalised least squares, the joint estimate) are left to it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.least_squares.gram import Sums, normal_equations
from identify.least_squares.pooling import Pooling
from identify.least_squares.residual_spectrum import LEAST_GAIN
from identify.least_squares.run_information import Excitation, excitation
from identify.results.ledger import CONVENTIONAL, Ledger, drawn_row, type_a_rows
from identify.rigid_body.inertia import COMPONENTS, Body
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, cross_matrix
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import typical_errors
from uq.monte_carlo.gram_sums.error_maps import OF_THE_RIG, Platform, WrenchBasis
from uq.runs.identification.recorded_sums import FEATURES, FORCE, MOMENT, sums_of_signals
from uq.runs.identification.systematic_errors import Systematic, SystematicProblem, propagated
from uq.runs.identification.undeclared import tensor_changes
from uq.runs.live.running_sums import RunningSums
from uq.sources.source import Source

TRIALS = 2000
"""Draws of the declared sources."""
UNKNOWNS = 9
"""Number of unknowns: the tensor, and a constant moment."""
REACH, OWN, PASSED, DISAGREE = 3, 100, 0.5, 2.5
"""Bands above a band from which it takes lines; least degrees of freedom of a band whose agreement can be judged; least
gain of the filter at such lines; and standard deviations at which bands disagree."""


class LiveFit(NamedTuple):
    """Least squares on the sums so far."""

    inertia: Float[np.ndarray, "6"]
    """Packed tensor of the body [kg·m²]; of least norm where directions are not excited."""
    covariance: Float[np.ndarray, "6 6"]
    """Covariance of ``inertia`` by type A evaluation [(kg·m²)²]."""
    degrees_of_freedom: Float[np.ndarray, "6"]
    excitation: Excitation


@dataclass(frozen=True)
class LiveEstimate:
    """The estimate from the blocks of a run so far. SI units."""

    seconds: float
    """Duration of the motion so far [s]."""
    inertia: Float[np.ndarray, "6"]
    """Packed tensor of the body [kg·m²]."""
    standard_uncertainty: Float[np.ndarray, "6"]
    """Type A and declared sources together [kg·m²]."""
    interval95: Float[np.ndarray, "6 2"]
    type_a: Float[np.ndarray, "6"]
    """Half the interval of 95 % from the residuals alone [kg·m²]."""
    of_sources: Float[np.ndarray, "6"]
    """Half the interval of 95 % from the declared sources alone, which no time averages away [kg·m²]."""
    largest_source: tuple[str | None, ...]
    """Declared source that contributes most, by component."""
    undeclared: Float[np.ndarray, "6"]
    """Part of half the conventional bound from undeclared errors at typical size [kg·m²]; but for cross-talk, delay
    and mounting, which the sums do not tell."""
    undetermined: tuple[str, ...] = ()
    """Components that the motion so far does not determine."""

    @property
    def half_width(self) -> Float[np.ndarray, "6"]:
        """Half the interval of 95 % [kg·m²]; infinite where the motion does not determine the tensor yet."""
        half = (self.interval95[:, 1] - self.interval95[:, 0]) / 2
        return np.full(6, np.inf) if self.undetermined else half

    def seconds_to(self, target: float) -> float:
        """Return how much more motion of this kind the target takes [s]; infinite: no time reaches it."""
        if self.undetermined or self.forbids(target) is not None:
            return np.inf
        remaining = np.maximum(target**2 - self.of_sources**2, 1e-300)
        needed = np.where(self.half_width > target, self.type_a**2 / remaining, 1.0)
        return float(max(self.seconds * (needed.max() - 1.0), 0.0))

    def forbids(self, target: float) -> tuple[str, str, float] | None:
        """Return what stands in the way of a half-width [kg·m²] for good: source, component, and what it leaves."""
        if self.undetermined:
            return None
        k = int(np.argmax(self.of_sources))
        source = self.largest_source[k]
        return None if source is None or self.of_sources[k] < target else (source, COMPONENTS[k], self.of_sources[k])


def sources_in(experiment: Experiment) -> tuple[Source, ...]:
    """Return the constant sources that a live estimate holds: all that ``inertia identify`` has but for air's."""
    return tuple(s for s in experiment.sources if s.constant and s.perturbs and s.perturbs not in OF_THE_RIG)


def estimated(sums: RunningSums, experiment: Experiment) -> LiveEstimate:
    """Return the estimate from the sums so far; of a run with at least one row."""
    fitted = fit(sums, experiment.stated_r_cg)
    undetermined = _undetermined(fitted.excitation)
    zero = np.zeros(6)
    together = Pooling(
        runs=1, mountings=0, from_residuals=fitted.covariance, residual_degrees_of_freedom=fitted.degrees_of_freedom,
        from_scatter=None, predicted=np.sqrt(np.diag(fitted.covariance)), between_runs=None, between_mountings=None,
        repeat_degrees_of_freedom=0, scatter_degrees_of_freedom=0, from_redrawn_sources=zero,
    )  # fmt: skip
    if undetermined:
        nothing = np.full(6, np.nan)
        return LiveEstimate(
            seconds=sums.seconds, inertia=fitted.inertia, standard_uncertainty=nothing,
            interval95=np.full((6, 2), np.nan), type_a=together.half_width, of_sources=nothing,
            largest_source=(None,) * 6, undeclared=nothing, undetermined=undetermined,
        )  # fmt: skip
    systematic = propagated(_problem(sums, fitted.inertia, experiment, sources_in(experiment)), trials=TRIALS)
    declared = Ledger(tuple(drawn_row(name, errors) for name, errors in systematic.alone.items()))
    ledger = declared.joined(type_a_rows(together))
    return LiveEstimate(
        seconds=sums.seconds, inertia=fitted.inertia,
        standard_uncertainty=ledger.standard_uncertainty[4:],
        interval95=fitted.inertia[:, None] + ledger.arms()[4:] * [-1, 1], type_a=together.half_width,
        of_sources=declared.arms()[4:].mean(axis=1), largest_source=_largest(systematic),
        undeclared=_undeclared(sums, fitted.inertia, experiment),
    )  # fmt: skip


def fit(sums: RunningSums, r_cg: Float[np.ndarray, "3"]) -> LiveFit:
    """Return the tensor with its type A covariance, from sums alone."""
    centred = sums.products - np.outer(sums.products[0], sums.products[0]) / sums.products[0, 0]
    normal, right = normal_equations(_sums(centred), r_cg)
    inverse = np.linalg.pinv(normal, hermitian=True)
    inertia = inverse @ right
    mean = sums.products[0] / sums.products[0, 0]
    moment_map = np.swapaxes(OMEGA_R_OF_FEATURES, 0, 1)  # axis, feature, component
    constant = mean[MOMENT] - np.cross(r_cg, mean[FORCE]) - np.einsum("afi,f,i->a", moment_map, mean[FEATURES], inertia)
    rows = np.zeros((3, UNKNOWNS, len(FEATURES)))  # of the regression, from the features
    rows[:, :6] = np.swapaxes(moment_map, 1, 2)
    rows[np.arange(3), 6 + np.arange(3), 0] = 1.0
    residual = np.hstack([-np.einsum("auf,u->af", rows, np.append(inertia, constant)), -cross_matrix(r_cg), np.eye(3)])
    features = sums.products[np.ix_(FEATURES, FEATURES)]
    spread = np.linalg.pinv(np.einsum("auf,fg,avg->uv", rows, features, rows), hermitian=True)
    covariance, freedom = _type_a(sums, rows, residual, spread)
    return LiveFit(inertia, covariance[:6, :6], freedom[:6], excitation(normal, sums.noise))


def _type_a(
    sums: RunningSums, rows: np.ndarray, residual: np.ndarray, spread: np.ndarray
) -> tuple[Float[np.ndarray, "9 9"], Float[np.ndarray, "9"]]:
    """Covariance of the unknowns from the residuals' spectrum, and its degrees of freedom (GUM G.4)."""
    filled = sums.lines > 0
    count, spectra = sums.lines[filled], sums.spectra[filled]
    feature_spectra = spectra[:, : rows.shape[2], : rows.shape[2]]
    products = np.einsum("auf,bfg,cvg->bacuv", rows, feature_spectra, rows, optimize=True)
    leverage = np.einsum("baauv,uv->ba", products, spread)
    free = np.maximum(count[:, None] - leverage, 1.0)
    gain = np.maximum(sums.gain[filled] / count, LEAST_GAIN)[:, None, None]
    squares = np.einsum("ak,bkl,cl->bac", residual, spectra, residual) / gain
    taken = agreeing(squares, free, gain[:, 0, 0])
    dof = taken @ free
    root = np.sqrt(dof)
    errors = gain * np.tensordot(taken, squares, 1) / (root[:, :, None] * root[:, None, :])
    scores = np.einsum("bac,bacuv->uv", errors, products)
    diagonal = np.einsum("uv,baavw,wu,baa->bau", spread, products, spread, errors, optimize=True)
    total = np.maximum(diagonal.sum(axis=(0, 1)), 1e-300)
    line_variances = np.einsum("bk,bau->kau", taken, diagonal / dof[:, :, None])  # bands that share lines err together
    freedom = total**2 / np.maximum((line_variances**2 * free[:, :, None]).sum(axis=(0, 1)), 1e-300)
    return spread @ scores @ spread, np.clip(freedom, 1.0, 1e9)


def agreeing(
    squares: Float[np.ndarray, "b 3 3"], free: Float[np.ndarray, "b 3"], gain: Float[np.ndarray, " b"]
) -> Bool[np.ndarray, "b b"]:
    """Return for each band which bands of the residuals' spectrum tell its noise: itself and those above that agree.

    A motion of one frequency fills one band, whose few lines would leave the uncertainty, and with it the time at which
    it reaches a target, to chance. The next band is taken in unless its variance on some axis is ``DISAGREE`` standard
    deviations from that of the bands taken before: the logarithm of a variance of n degrees of freedom has the variance
    2/n. So noise that falls or rises with frequency stays apart.

    Args:
        squares: sums of the residuals' products across the axes, the filter's gain divided out.
        free: degrees of freedom left in each band, by axis.
        gain: mean power gain of the estimator's filter.
    """
    taken = np.eye(len(free), dtype=bool)
    power = np.maximum(np.einsum("baa->ba", squares), 1e-300)
    for b in map(int, np.flatnonzero((free >= OWN).all(axis=1) & (gain >= PASSED))):
        for k in range(b + 1, min(b + REACH + 1, len(free))):
            total, dof = power[taken[b]].sum(axis=0), free[taken[b]].sum(axis=0)
            apart = np.abs(np.log(power[k] / free[k] / (total / dof)))
            if gain[k] < PASSED or (apart > DISAGREE * np.sqrt(2 / dof + 2 / free[k])).any():
                break
            taken[b, k] = True
    return taken


def _sums(products: np.ndarray) -> Sums:
    rows = products[FEATURES]
    return Sums(rows[:, FEATURES], rows[:, FORCE], rows[:, MOMENT])


def _undeclared(sums: RunningSums, inertia: np.ndarray, experiment: Experiment) -> np.ndarray:
    """Half the conventional bound from undeclared errors alone, (6,) [kg·m²]."""
    errors = typical_errors(experiment, largest=(0.0, 0.0))  # the sums do not tell the largest force and moment
    sources = tuple(source for source in sources_in(errors) if source.perturbs != "gyro_delay")
    changes = tensor_changes(_problem(sums, inertia, errors, sources)).values()
    return CONVENTIONAL * np.sqrt(sum((np.sum(change**2, axis=1) for change in changes), np.zeros(6)))


def _problem(
    sums: RunningSums, inertia: np.ndarray, experiment: Experiment, sources: tuple[Source, ...]
) -> SystematicProblem:
    """Return the problem of the sources' draws, from the sums."""
    names = {source.name for source in sources}
    basis, r_cg = WrenchBasis.for_sources(sources), experiment.stated_r_cg
    of_run = sums_of_signals(
        sums.delayed, sums.delayed[:, 0], delays=sums.delays, r_cg=r_cg, inertia=inertia, basis=basis, centred=True
    )
    mass = experiment.mass if experiment.scale is None else experiment.scale[0]
    return SystematicProblem(
        sums=(of_run,), body=Body(np.asarray(mass or 0.0), r_cg, inertia),
        platform=Platform(np.array(experiment.gravity), np.zeros(3)), sources=sources,
        mixing=tuple(mix for mix in experiment.mixing if names & set(mix.names)),
        basis=basis, sources_of_poses=(), redrawn=frozenset(), offsets="estimate", weighed=False,
    )  # fmt: skip


def _largest(systematic: Systematic) -> tuple[str | None, ...]:
    if not systematic.alone:
        return (None,) * 6
    names = list(systematic.alone)
    spread = np.array([systematic.alone[name].std(axis=0) for name in names])
    return tuple(names[k] if spread[k, c] > 0 else None for c, k in enumerate(spread.argmax(axis=0)))


def _undetermined(verdict: Excitation) -> tuple[str, ...]:
    if verdict.identifiable.all():
        return ()
    return verdict.unidentifiable or tuple(COMPONENTS)
