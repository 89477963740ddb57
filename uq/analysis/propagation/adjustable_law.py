"""The law of propagation as a function of its sources' figures, of the duration and of the amplitude, for a page.

Numbers from which a few lines of JavaScript (``uq/templates/adjustable.js``) tell each source's part in variance and
mean error at once. With s_i the factor on a source's figure, its part in the variance is ``s² J Σ Jᵀ + s⁴ ½ tr(HΣHΣ)``,
in the mean ``s² ½ tr(HΣ)``: exact where the law is expanded. It is expanded about the expected sums, which the gyro's
noise moves; so these numbers are given at several levels of that noise. Between them their logarithms are interpolated.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.propagation.expansion import Expansion, propagate_case
from uq.analysis.propagation.inputs import CaseInputs, Constants, constants_of, inputs_of_cases
from uq.analysis.propagation.prepared_run import PreparedRun
from uq.analysis.propagation.undrawn_errors import undrawn_errors, without_undrawn
from uq.experiment.experiment import Experiment
from uq.files.units import printed
from uq.monte_carlo.gram_sums.cases import Case
from uq.sources.datasheet import stated_figure
from uq.sources.draw_figures import part_of
from uq.sources.source import Source

LEVELS = 10.0 ** (np.arange(-4, 5) / 2)
"""Factors on the variance of the gyro's noise, from a hundredth to a hundred; 1 is in the middle."""
NEGLIGIBLE = 1e-5
"""Joint effects of two sources below this part of their variance are left out."""
DIGITS = 6
WRITTEN = {"sigma": "σ", "half_width": "half-width", "scale": "scale", "datasheet": "datasheet"}
"""Keys of a source's size in a file, and what a page calls them."""
SMALL = {"m": "mm", "s": "ms", "rad": "mrad", "kg": "g"}
"""Units of figures below a hundredth."""


def adjustable(experiment: Experiment, runs: Mapping[str, PreparedRun], estimators: Sequence[str]) -> dict[str, Any]:
    """Return the numbers as JSON takes them, in g·m², for every trajectory and estimator.

    Args:
        experiment: with the sources as they stand.
        runs: sums over its trajectories.
        estimators: names, in the order of the runs'.

    Raises:
        ExperimentError: a source that the law cannot take.
    """
    constants = constants_of(experiment.sources, experiment.mixing)
    pairs = []
    for name, run in runs.items():
        spec = experiment.trajectories[name]
        parts = contributions_of(experiment, run, constants, spec.rate)
        _, undrawn = without_undrawn(_all_of(experiment.sources), experiment.sources)
        same = undrawn_errors(experiment, spec, estimators, run, {undrawn})[undrawn]
        parts = parts._replace(rest=parts.rest + same)
        pairs += [
            {"trajectory": name, "estimator": estimator, "duration": spec.duration, **_written(parts, k)}
            for k, estimator in enumerate(estimators)
        ]
    return {"components": list(COMPONENTS), "levels": _plain(LEVELS),
            "sources": described(experiment), "pairs": pairs}  # fmt: skip


class Contributions(NamedTuple):
    """Contributions to variance [(kg·m²)²] and mean error [kg·m²].

    The axes are estimators, levels of the gyro's noise, sources, components.
    """

    first: np.ndarray
    """Part of the variance that grows with the square of a source's factor."""
    second: np.ndarray
    """Part of the variance that grows with the fourth power of a source's factor."""
    mean: np.ndarray
    """Part of the mean error that grows with the square of a source's factor."""
    gyro: np.ndarray
    """Each source's share in the variance of omega's white noise."""
    gyro_variance: np.ndarray
    """Part of the variance that omega's white noise causes, over its level, without the axis of sources."""
    gyro_mean: np.ndarray
    expected: np.ndarray
    """Part of the mean error that the sources' expectations cause, without the axis of levels."""
    rest: np.ndarray
    """Mean error that is no random source's: estimators, components."""
    joint: list[tuple[int, int, np.ndarray]]
    """Two sources and, by estimator, their interaction: with ``s_i s_j`` in the variance, with its square
    there, with ``s_i s_j`` in the mean."""

    def by_noise(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what each source adds to variance and mean error, but for its expectation, at the first level."""
        share = self.gyro[None, :, None]
        return (
            self.first[:, 0] + self.second[:, 0] + share * self.gyro_variance[:, 0, None],
            self.mean[:, 0] + share * self.gyro_mean[:, 0, None],
        )


def contributions_of(
    experiment: Experiment, run: PreparedRun, constants: Constants, rate: float, levels: np.ndarray = LEVELS
) -> Contributions:
    """Return the parts of one run's sources, all of them acting, at factors on the variance of the gyro's noise."""
    sources = experiment.sources
    random, _ = without_undrawn(_all_of(sources), sources)
    alone = [Case(s.name, random.sources & {s.name}) for s in sources]
    both = list(combinations(range(len(sources)), 2))
    cases = [*alone, *(Case("", alone[i].sources | alone[j].sources) for i, j in both)]
    inputs = inputs_of_cases(cases, constants, sources, experiment.mixing, rate, run.peaks)
    n = len(sources)
    gyro, expected = inputs.gyro[:n].sum(axis=0), constants.errors @ constants.mean
    quiet = run.expansion(expected, np.zeros(3), constants.errors)
    by_level = [_alone(run, constants, inputs, n, expected, level * gyro) for level in levels]
    effects = _Alone(*(np.stack(part, axis=1) for part in zip(*by_level, strict=True)))
    nominal = run.body.inertia
    means = (inputs.acts[:n] * constants.mean) @ quiet.jacobian.swapaxes(-1, -2)
    share = inputs.gyro[:n].sum(axis=1) / (gyro.sum() or 1.0)
    joint = _joint(run, constants, inputs, both, expected, gyro)
    rest = quiet.value - nominal - means.sum(axis=1)
    level = levels[:, None]
    return Contributions(
        first=effects.first, second=effects.second, mean=effects.mean, gyro=share,
        gyro_variance=effects.gyro_variance / level, gyro_mean=(effects.gyro_value - quiet.value[:, None]) / level,
        expected=means, rest=rest, joint=joint,
    )  # fmt: skip


def _all_of(sources: Sequence[Source]) -> Case:
    return Case("total", frozenset(source.name for source in sources))


class _Alone(NamedTuple):
    """Effects of each source alone, and of the gyro's noise, at one level of that noise."""

    first: np.ndarray
    second: np.ndarray
    mean: np.ndarray
    gyro_variance: np.ndarray
    gyro_value: np.ndarray
    """The estimate with this noise alone."""


def _alone(
    run: PreparedRun, constants: Constants, inputs: CaseInputs, n: int, expected: np.ndarray, variance: np.ndarray
) -> _Alone:
    """Return the effects of the first n cases, in which a source acts alone, where the gyro's noise has a variance."""
    expansion, noise = run.expansion(expected, variance, constants.errors), run.scatter(variance)
    about = Expansion(*(leaf[:, None] for leaf in expansion))
    covariance = constants.covariance(inputs.acts)[:n]
    cell = run.cell_scatter(noise.mean[:, None], inputs.wrench[:n])
    scatter = noise.covariance[:, None]
    none = np.zeros_like(covariance[:1])
    constants_alone, gyro_alone = propagate_case(about, covariance, cell), propagate_case(about, none, scatter)
    together = propagate_case(about, covariance, cell + scatter)
    # polarisation: what a source and the gyro's noise make together, less what each makes alone
    crossed = _diagonal(together.covariance - constants_alone.covariance - gyro_alone.covariance)
    first = _diagonal(constants_alone.first_order)
    return _Alone(
        first=first + crossed, second=_diagonal(constants_alone.covariance) - first,
        mean=constants_alone.mean - about.value, gyro_variance=_diagonal(gyro_alone.covariance)[:, 0],
        gyro_value=gyro_alone.mean[:, 0],
    )  # fmt: skip


def _joint(
    run: PreparedRun, constants: Constants, inputs: CaseInputs, both: Sequence[tuple[int, int]], expected: np.ndarray,
    gyro: np.ndarray,
) -> list[tuple[int, int, np.ndarray]]:  # fmt: skip
    """Return the joint effects of two sources beyond their separate ones, where they count."""
    expansion, noise = run.expansion(expected, gyro, constants.errors), run.scatter(gyro)
    about = Expansion(*(leaf[:, None] for leaf in expansion))
    cell = run.cell_scatter(noise.mean[:, None], inputs.wrench)
    moments = propagate_case(about, constants.covariance(inputs.acts), cell)
    # J Σ Jᵀ goes with the square of a factor on σ, ½ tr(H Σ H Σ) with its fourth power, ½ tr(H Σ) with its square, so
    # that a page computes the law for any factors
    first = _diagonal(moments.first_order)
    effects = np.stack([first, _diagonal(moments.covariance) - first, moments.mean - about.value], axis=2)
    n = effects.shape[1] - len(both)
    joint = []
    for k, (i, j) in enumerate(both):
        beyond, variance = effects[:, n + k] - effects[:, i] - effects[:, j], effects[:, n + k, :2].sum(axis=1)
        if (abs(beyond[:, :2].sum(axis=1)) > NEGLIGIBLE * variance.max(axis=-1, keepdims=True)).any():
            joint.append((i, j, beyond))
    return joint


def _diagonal(matrices: np.ndarray) -> np.ndarray:
    return np.diagonal(matrices, axis1=-2, axis2=-1)


def _written(parts: Contributions, estimator: int) -> dict[str, Any]:
    """One estimator's numbers, in g·m²."""
    square = GRAM_METRE**2
    return {
        "first": _plain(square * parts.first[estimator]), "second": _plain(square * parts.second[estimator]),
        "mean": _plain(GRAM_METRE * parts.mean[estimator]), "gyro": _plain(parts.gyro),
        "gyroVariance": _plain(square * parts.gyro_variance[estimator]),
        "gyroMean": _plain(GRAM_METRE * parts.gyro_mean[estimator]),
        "expected": _plain(GRAM_METRE * parts.expected[estimator]), "rest": _plain(GRAM_METRE * parts.rest[estimator]),
        "joint": [
            [i, j, *_plain(np.array([[square], [square], [GRAM_METRE]]) * beyond[estimator])]
            for i, j, beyond in parts.joint
        ],
    }  # fmt: skip


def _plain(values: np.ndarray) -> Any:
    rounded = [float(f"{value:.{DIGITS}g}") for value in np.ravel(values)]
    return np.reshape(rounded, np.shape(values)).tolist()


def described(experiment: Experiment) -> list[dict[str, Any]]:
    """Return name, group, and figure with its unit of each source, as its file states them: the largest axis's."""
    entries = experiment.document.get("source", ()) if experiment.is_of_document() else ()
    written = {entry["name"]: entry for entry in entries}
    return [_described(source, written.get(source.name, {})) for source in experiment.sources]


def _described(source: Source, entry: Mapping[str, Any]) -> dict[str, Any]:
    what, figure, unit = _as_written(source, entry) or _in_si(source)
    return {"name": source.name, "group": source.group, "what": what, "unit": printed(unit),
            "figure": float(f"{figure:.{DIGITS}g}"), "axes": int(np.size(source.sigma))}  # fmt: skip


def _as_written(source: Source, entry: Mapping[str, Any]) -> tuple[str, float, str] | None:
    """Key, number and unit of a source's size as its file states it; None: no number and unit stand there."""
    key = next((key for key in (*WRITTEN, *source.error_kind.sizes) if key in entry), "")
    texts = np.ravel(entry.get(key, ()))
    sizes = np.ravel(np.abs(source.sigma))
    text = str(texts[np.argmax(sizes) if len(texts) == len(sizes) else 0]) if len(texts) else ""
    if key == "datasheet":
        return (key, *stated_figure(text))
    number, _, unit = text.partition(" ")
    try:
        return (WRITTEN.get(key, key), abs(float(number)), unit)
    except ValueError:
        return None


def _in_si(source: Source) -> tuple[str, float, str]:
    """The standard deviation, or another size, in SI, or in a thousandth of it."""
    kind = source.error_kind
    what, figures, unit = "σ", source.sigma, kind.targets[source.target]
    stated = [size for size in kind.sizes if size in source.settings]
    if stated and not np.any(source.sigma):
        what = stated[0]
        figures, unit = source.settings[what], kind.unit_of_size(source.target, what)
    figure = float(np.max(np.abs(figures))) / part_of(unit)
    return (what, 1000 * figure, SMALL[unit]) if unit in SMALL and figure < 0.01 else (what, figure, unit)
