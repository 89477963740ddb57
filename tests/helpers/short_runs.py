"""Type A of short runs: how the errors of ``identify`` compare with the standard uncertainty from residuals.

``python -m tests.helpers.short_runs [--laboratories N] [--cases WORD] [--methods source gls joint]``. A laboratory
is ten runs of one body, simulated in NumPy: the moment about the centre of gravity follows from Euler's equation, and an
error is added to it (:data:`ERRORS`): noise of several colours, or what a model lacks and follows the motion. A line has

- *error/u*: root mean square of a single run's error over that of its standard uncertainty, of all components and of the
  two extreme ones;
- *scatter/u*: the same of the runs about their laboratory's mean, which an error that all runs share leaves out;
- coverage and half-width of single runs' and of pooled intervals of 95 %; the half-width is over 1.96 root mean square
  errors, of the components' median;
- *score*: mean interval score over that of an interval of 1.96 root mean square errors.

No judge takes part: nothing is widened by causes.
"""

import argparse
from collections.abc import Callable, Iterator
from typing import Literal, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from identify.estimation.joint.priors import Alignment
from identify.estimation.methods.base import Problem, estimator_of
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import unpack
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from tests.helpers.interval_quality import FACTOR, interval_score

RUNS = 10
RATE = 1000.0
LONG = 20.0
"""Duration from which a third of the laboratories is simulated [s]."""
BODY = np.array([1.7e-3, 2e-5, 1e-5, 0.6e-3, -2e-5, 1.5e-3])
"""Packed tensor [kg·m²]."""
EXACT = Alignment(sigma_delay=0.0, sigma_rotation=0.0, sigma_gyro_bias=0.0)
Signal = Float[np.ndarray, "n 3"]
ErrorSource = Callable[[np.random.Generator, "Motion", np.random.Generator], Signal]
"""From a run's generator, its motion and the laboratory's generator to an error of the moment [N·m]."""


class Motion(NamedTuple):
    """A body's motion and the moment about its centre of gravity."""

    omega: Signal
    alpha: Signal
    moment: Signal


class Case(NamedTuple):
    """Runs of a laboratory."""

    seconds: float
    motion: Literal["thrown", "swung"]
    error: str
    lowpass: float | None
    """Of both sides of the regression [Hz]; None: a differentiator for a motion below 10 Hz."""
    offsets: Literal["none", "estimate"]

    def __str__(self) -> str:
        behind = "smoothed" if self.lowpass is None else f"{self.lowpass:g} Hz"
        offset = "" if self.offsets == "none" else ", offset"
        return f"{self.seconds:g} s, {self.motion}, {behind}{offset}, {self.error}"


def thrown(draw: np.random.Generator, count: int) -> Motion:
    """Return a tumbling body: a spin of 10 rad/s, and two turns of 1 to 4 Hz about each axis."""
    spin = draw.normal(size=3)
    return turning(
        count, 10 * spin / np.linalg.norm(spin), draw.uniform(1, 4, (2, 3)), draw.uniform(3, 7, (2, 3)), draw
    )


def swung(draw: np.random.Generator, count: int) -> Motion:
    """Return three sinusoids of 0.4 to 2.5 Hz about each axis."""
    return turning(count, np.zeros(3), draw.uniform(0.4, 2.5, (3, 3)), draw.uniform(0.5, 1.5, (3, 3)), draw)


def turning(count: int, spin: np.ndarray, rates: np.ndarray, size: np.ndarray, draw: np.random.Generator) -> Motion:
    """Return a spin [rad/s] and sinusoids about each axis, (sinusoids, 3) [Hz] [rad/s], with their moment."""
    angular = 2 * np.pi * rates
    angle = np.multiply.outer(np.arange(count) / RATE, angular) + draw.uniform(0, 2 * np.pi, rates.shape)
    omega, alpha = spin + (size * np.sin(angle)).sum(axis=1), (size * angular * np.cos(angle)).sum(axis=1)
    return Motion(omega, alpha, moment_of(omega, alpha))


def moment_of(omega: Signal, alpha: Signal) -> Signal:
    """Return the moment of Euler's equation [N·m]."""
    inertia = unpack(BODY)
    return alpha @ inertia + np.cross(omega, omega @ inertia)


def noise(draw: np.random.Generator, motion: Motion, density: Callable[[np.ndarray], np.ndarray]) -> Signal:
    """Return stationary noise of a power density, of 2 % of the moment below 10 Hz."""
    count = 8 * max(len(motion.moment), int(RATE))
    frequency = np.fft.rfftfreq(count, 1 / RATE)[1:]
    power = density(frequency)
    level = np.sqrt(power / power[frequency < 10].sum())
    lines = (draw.normal(size=(3, len(frequency))) + 1j * draw.normal(size=(3, len(frequency)))) / np.sqrt(2)
    spectrum = np.concatenate([np.zeros((3, 1)), lines * level], axis=1)
    signal = np.fft.irfft(spectrum, count, axis=1).T[: len(motion.moment)] * count / np.sqrt(2)
    return 0.02 * np.sqrt(np.mean(motion.moment**2)) * signal


def white(draw: np.random.Generator, motion: Motion, _: np.random.Generator) -> Signal:
    """Return white noise."""
    return noise(draw, motion, np.ones_like)


def lowpassed(draw: np.random.Generator, motion: Motion, _: np.random.Generator) -> Signal:
    """Return noise behind a low-pass of 4 Hz of two poles."""
    return noise(draw, motion, lambda f: 1 / (1 + (f / 4) ** 4))


def drift(draw: np.random.Generator, motion: Motion, _: np.random.Generator) -> Signal:
    """Return a first-order autoregression, of a corner of 0.5 Hz."""
    return noise(draw, motion, lambda f: 1 / (0.25 + f**2))


def flicker(draw: np.random.Generator, motion: Motion, _: np.random.Generator) -> Signal:
    """Return noise of a density ``1/f``."""
    return noise(draw, motion, lambda f: 1 / f)


def uneven(draw: np.random.Generator, motion: Motion, rig: np.random.Generator) -> Signal:
    """Return a drift of two axes and white noise of the third."""
    return np.where([True, True, False], drift(draw, motion, rig), white(draw, motion, rig))


def vibration(draw: np.random.Generator, motion: Motion, rig: np.random.Generator) -> Signal:
    """Return a vibration of 12 to 25 Hz about the third axis, of a tenth of the moment, and a third of a drift."""
    t = np.arange(len(motion.moment)) / RATE
    shaken = np.sin(2 * np.pi * (rig.uniform(12, 25) * t + draw.uniform()))
    size = 0.1 * np.sqrt(np.mean(motion.moment**2))
    return np.outer(shaken, [0, 0, size]) + 0.3 * drift(draw, motion, rig)


def turned_axes(draw: np.random.Generator, motion: Motion, rig: np.random.Generator) -> Signal:
    """Return what an IMU turned in its mounting by some 1.4 degrees, the same in all runs, lacks; a little drift."""
    turn = np.eye(3) + np.cross(np.eye(3), rig.normal(0, 0.014, 3))
    return moment_of(motion.omega @ turn, motion.alpha @ turn) - motion.moment + 0.3 * drift(draw, motion, rig)


def follows_motion(draw: np.random.Generator, motion: Motion, rig: np.random.Generator) -> Signal:
    """Return what every run lacks alike: moments a quarter period late, products of the rates; a little noise.

    The coefficients are the rig's.
    """
    size, rates = np.sqrt(np.mean(motion.moment**2)), motion.omega
    integral = np.cumsum(motion.moment - motion.moment.mean(axis=0), axis=0)
    square = np.stack([rates[:, 0] * rates[:, 1] * rates[:, 2], rates[:, 0] ** 3, rates[:, 1] ** 3], axis=1)
    parts = [part / np.sqrt(np.mean(part**2)) @ rig.normal(size=(3, 3)) / np.sqrt(3) for part in (integral, square)]
    return 0.02 * size * sum(parts) / np.sqrt(2) + 0.1 * white(draw, motion, rig)


def each_its_own(draw: np.random.Generator, motion: Motion, rig: np.random.Generator) -> Signal:
    """Return the same with coefficients that each run draws."""
    return follows_motion(draw, motion, draw)


ERRORS: dict[str, ErrorSource] = {
    "white": white, "low-passed": lowpassed, "drift": drift, "flicker": flicker, "uneven": uneven,
    "vibration": vibration, "turned": turned_axes, "follows, rig": follows_motion, "follows, run": each_its_own,
}  # fmt: skip

CASES = (
    *(Case(0.5, "thrown", error, 10.0, "none") for error in ERRORS),
    *(Case(1.0, "thrown", error, 10.0, "none") for error in ("white", "drift", "uneven", "vibration")),
    *(Case(1.0, "thrown", error, None, "estimate") for error in ("white", "drift", "uneven")),
    *(Case(3.0, "swung", error, 10.0, "estimate") for error in ERRORS),
    *(Case(5.0, "swung", error, None, "none") for error in ERRORS),
    *(Case(30.0, "swung", error, 10.0, "estimate") for error in ("white", "drift", "flicker", "uneven")),
    *(Case(60.0, "swung", error, None, "estimate") for error in ("white", "drift", "uneven")),
)


def laboratory(case: Case, seed: int) -> list[Run]:
    """Return the runs of a laboratory."""
    draw, rig_seed, runs = np.random.default_rng((seed, 0)), (seed, 1), []
    for number in range(RUNS):
        motion = {"thrown": thrown, "swung": swung}[case.motion](draw, round(case.seconds * RATE))
        moment = motion.moment + ERRORS[case.error](draw, motion, np.random.default_rng(rig_seed))
        omega = motion.omega + 1e-4 * draw.normal(size=motion.omega.shape)
        t = np.arange(len(omega)) / RATE
        runs.append(Run.from_arrays(t, np.zeros_like(moment), moment, omega, name=str(number)))
    return runs


def fitted(case: Case, runs: list[Run], method: str) -> Identification:
    """Return the result of an estimator, which nobody judges."""
    smooth = EstimatorSpec("smoothed", "savitzky-golay", band=10.0)
    spec = smooth if case.lowpass is None else EstimatorSpec("low-passed", "central", lowpass=case.lowpass)
    problem = Problem(
        tuple(runs), np.zeros(3), np.zeros(3), estimator=spec, offsets=case.offsets, alignment=EXACT, mass=1.0,
    )  # fmt: skip
    return estimator_of(method).fit(problem)


class Answers(NamedTuple):
    """Errors, standard uncertainties and half-widths, (laboratories, runs, 6) [kg·m²]."""

    error: np.ndarray
    sigma: np.ndarray
    half: np.ndarray

    @classmethod
    def of(cls, results: list[list[Identification]]) -> "Answers":
        """Return those of results, a list for each laboratory."""

        def each(value: Callable[[Identification], np.ndarray]) -> np.ndarray:
            return np.array([[value(result) for result in laboratory] for laboratory in results])

        return cls(
            each(lambda r: r.inertia - BODY),
            each(lambda r: np.sqrt(np.diag(r.covariance))),
            each(lambda r: np.diff(r.interval95)[:, 0] / 2),
        )

    def flat(self) -> "Answers":
        """Return those of all laboratories together, (runs, 6)."""
        return Answers(*(values.reshape(-1, 6) for values in self))

    def ratio(self) -> np.ndarray:
        """Return the root mean square of errors over that of the standard uncertainties, by component."""
        error, sigma, _ = self.flat()
        return np.sqrt((error**2).mean(axis=0) / (sigma**2).mean(axis=0))

    @property
    def mean_ratio(self) -> float:
        """Root mean square of :meth:`ratio`."""
        return float(np.sqrt(np.mean(self.ratio() ** 2)))

    def about_mean(self) -> "Answers":
        """Return these answers with their laboratory's mean in place of the truth."""
        runs = self.error.shape[1]
        apart = (self.error - self.error.mean(axis=1, keepdims=True)) * np.sqrt(runs / (runs - 1))
        return self._replace(error=apart)

    def widths(self) -> str:
        """Return coverage, the half-width over 1.96 root mean square errors, and the score over the honest one's."""
        error, _, half = self.flat()
        honest = FACTOR * np.sqrt((error**2).mean(axis=0))
        held = (np.abs(error) <= half).mean()
        score, honest_score = (
            interval_score(np.stack([error - width, error + width], axis=-1), np.zeros(6)).mean(axis=0)
            for width in (half, honest)
        )
        return f"{100 * held:.1f} | {np.median(half / honest):.2f} | {(score / honest_score).mean():.2f}"


def row(case: Case, method: str, laboratories: int) -> str:
    """Return the line of a case."""
    labs = [laboratory(case, seed) for seed in range(laboratories if case.seconds < LONG else -(-laboratories // 3))]
    single = Answers.of([[fitted(case, [run], method) for run in runs] for runs in labs])
    pooled = Answers.of([[fitted(case, runs, method)] for runs in labs])
    ratio = single.ratio()
    return (
        f"| {case} | {method} | {single.mean_ratio:.2f} ({ratio.min():.2f}, {ratio.max():.2f}) "
        f"| {single.about_mean().mean_ratio:.2f} "
        f"| {single.widths()} | {pooled.widths()} |"
    )


def table(cases: tuple[Case, ...], methods: list[str], laboratories: int) -> Iterator[str]:
    """Yield the table."""
    yield "| runs | method | error/u | scatter/u | held, % | half-width | score | pooled: held, % | half-width | score |"
    yield "|" + "---|" * 10
    for case in cases:
        for method in methods:
            yield row(case, method, laboratories)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--laboratories", type=int, default=20)
    parser.add_argument("--cases", default="", help="a word that the cases' names hold")
    parser.add_argument("--methods", nargs="+", default=["source"])
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    cases = tuple(case for case in CASES if arguments.cases in str(case))
    for line in table(cases, arguments.methods, arguments.laboratories):
        print(line, flush=True)


if __name__ == "__main__":
    main()
