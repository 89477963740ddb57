"""``python -m benchmarks.quasi_random``: what quasi-random trials save against random ones, where the truth is known.

By figure its exact value, what seed 0 says either way, the root mean square errors over repeats, their squared ratio
(how many random trials one quasi-random trial replaces) and how often the truth is within two stated standard errors.
Then what they save of many inputs and of the preset's campaign, and the trials of adaptive propagations
until two digits are stable.
"""

import argparse
from collections.abc import Callable, Mapping
from math import prod
from statistics import median

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402

from identify.display.rounding import with_uncertainty  # noqa: E402
from identify.display.text_tables import text_table  # noqa: E402
from uq.analysis.propagation.propagation_of_distributions import propagate_distributions  # noqa: E402
from uq.analysis.sensitivity.sobol_shapley import Sensitivity, shapley, sobol  # noqa: E402
from uq.experiment.experiment import Experiment  # noqa: E402
from uq.monte_carlo.campaign.campaign import SamplingPlan, montecarlo  # noqa: E402
from uq.sources.distributions import Distribution, Normal, Rectangular  # noqa: E402
from uq.sources.quasi_random import Points  # noqa: E402

Inputs = Mapping[str, Distribution]
Model = Callable[[Mapping[str, jax.Array]], jax.Array]
Figures = tuple[np.ndarray, np.ndarray]
"""Values and standard errors."""
POINTS: tuple[Points, Points] = ("random", "quasi-random")
A, B = 7.0, 0.1
ISHIGAMI = dict.fromkeys("abc", Rectangular(-np.pi, np.pi))
SLOPES = {"a": 1.0, "b": -2.0, "c": 0.5, "d": 1.5}
NORMALS = dict.fromkeys(SLOPES, Normal(0.0, 1.0))


def ishigami(x: Mapping[str, jax.Array]) -> jax.Array:
    """Ishigami and Homma 1990."""
    return jnp.sin(x["a"]) + A * jnp.sin(x["b"]) ** 2 + B * x["c"] ** 4 * jnp.sin(x["a"])


def linear(x: Mapping[str, jax.Array]) -> jax.Array:
    """A weighted sum."""
    return sum((slope * x[name] for name, slope in SLOPES.items()), jnp.zeros(()))


def of_ishigami() -> dict[str, float]:
    """Return the exact indices."""
    alone, second, joint = (1 + B * np.pi**4 / 5) ** 2 / 2, A**2 / 8, B**2 * np.pi**8 * (1 / 18 - 1 / 50)
    whole = alone + second + joint
    first = {"a": alone, "b": second, "c": 0.0}
    total = {"a": alone + joint, "b": second, "c": joint}
    return {f"Ishigami, {kind} {name}": value / whole for kind, of in (("first", first), ("total", total))
            for name, value in of.items()}  # fmt: skip


def of_linear() -> dict[str, float]:
    """Return the exact Shapley effects."""
    whole = sum(slope**2 for slope in SLOPES.values())
    return {f"linear, Shapley {name}": slope**2 / whole for name, slope in SLOPES.items()}


def first_and_total(result: Sensitivity) -> Figures:
    """Return first orders, then totals."""
    kinds = [indices for indices in (result.first, result.total) if indices is not None]
    return tuple(np.concatenate([getattr(i, name)[:, 0] for i in kinds]) for name in ("value", "standard_error"))  # type: ignore[return-value]


def effects(result: Sensitivity) -> Figures:
    """Return Shapley effects."""
    assert result.shapley is not None
    return result.shapley.value[:, 0], result.shapley.standard_error[:, 0]


def rows(exact: Mapping[str, float], run: Callable[[int, Points], Figures], repeats: int) -> list[list[str]]:
    """Return a row a figure."""
    truth = np.array(list(exact.values()))
    value, error = (np.array(x) for x in zip(
        *(map(np.stack, zip(*(run(seed, points) for seed in range(repeats)), strict=True)) for points in POINTS),
        strict=True,
    ))  # fmt: skip
    off = value - truth
    square = (off**2).mean(1)
    held = (np.abs(off) <= 2 * error).mean(1)
    return [
        [name, f"{truth[k]:.4f}", *(with_uncertainty(value[p, 0, k], error[p, 0, k]) for p in (0, 1)),
         *(f"{np.sqrt(square[p, k]):.2g}" for p in (0, 1)), f"{square[0, k] / square[1, k]:.1f}",
         *(f"{100 * held[p, k]:.0f}" for p in (0, 1))]
        for k, name in enumerate(exact)
    ]  # fmt: skip


def sum_of(count: int) -> tuple[Model, Inputs, np.ndarray]:
    """A sum of normal inputs with the product of two; its totals."""
    names, slopes = [f"x{k:02}" for k in range(count)], np.linspace(1, 2, count)
    share = slopes**2 + (np.arange(count) < 2)
    model = lambda x: sum(b * x[n] for b, n in zip(slopes, names, strict=True)) + x["x00"] * x["x01"]  # noqa: E731
    return model, dict.fromkeys(names, Normal(0.0, 1.0)), share / (np.sum(slopes**2) + 1)


def product_of(count: int) -> tuple[Model, Inputs, np.ndarray]:
    """Sobol's g, a product of factors with a kink; its totals."""
    names, a = [f"x{k:02}" for k in range(count)], np.linspace(0, 9, count)
    v = 1 / (3 * (1 + a) ** 2)
    model = lambda x: prod((jnp.abs(4 * x[n] - 2) + b) / (1 + b) for b, n in zip(a, names, strict=True))  # noqa: E731
    whole = np.prod(1 + v)
    return model, dict.fromkeys(names, Rectangular(0.0, 1.0)), v * whole / (1 + v) / (whole - 1)


def many_inputs(repeats: int) -> list[list[str]]:
    """Return what quasi-random trials save of many inputs' totals, a row a model and number of trials."""
    table = []
    for label, build in (("sum", sum_of), ("Sobol's g", product_of)):
        for count in (12, 24):
            model, inputs, truth = build(count)
            cells = []
            for trials in (512, 8192):
                square = []
                for points in POINTS:
                    results = [sobol(model, inputs, trials=trials, seed=s, points=points).total for s in range(repeats)]
                    square.append(
                        np.mean([(total.value[:, 0] - truth) ** 2 for total in results if total is not None], axis=0)
                    )
                cells.append(f"{np.median(square[0] / square[1]):.1f}")
            table.append([f"{label} of {count} inputs", *cells])
    return table


def campaign(repeats: int) -> list[list[str]]:
    """Return what quasi-random trials save of the preset's campaign, a row a figure and number of trials."""
    experiment = Experiment.load("barreto2016")

    def figures(trials: int, seed: int, points: Points) -> Figures:
        plan = SamplingPlan(points=points)
        result = montecarlo(experiment, trials=trials, seed=seed, trajectories="T1", estimators="central", plan=plan)
        total, interval = result["T1", "central"].total, result.interval("T1", "central")
        values = [total.mean_error, total.three_sigma, interval.high]
        errors = [total.mean_error_standard_error, total.three_sigma_standard_error, interval.high_standard_error]
        return np.stack(values), np.stack(errors)

    truth, _ = figures(64 * 8192, 2**20, "quasi-random")
    table = []
    for trials in (1024, 8192, 10_000):
        off, error = {}, {}
        for points in POINTS:
            results = [figures(trials, seed, points) for seed in range(repeats)]
            off[points] = np.array([value for value, _ in results]) - truth
            error[points] = np.array([errors for _, errors in results])
        square = {points: (off[points] ** 2).mean(0) for points in POINTS}
        saved = np.median(square["random"] / square["quasi-random"], axis=1)
        relative = {points: np.sqrt(np.mean(square[points] / truth[1] ** 2, axis=1)) for points in POINTS}
        held = {p: (np.abs(off[p]) <= 2 * error[p]).mean((0, 2)) for p in POINTS}
        for k, name in enumerate(("mean error", "3σ", "upper end of 95 %")):
            table.append([f"{trials:,}", name, *(f"{100 * relative[p][k]:.2g}" for p in POINTS), f"{saved[k]:.0f}",
                          *(f"{100 * held[p][k]:.0f}" for p in POINTS)])  # fmt: skip
    return table


def salib(repeats: int, trials: int) -> str:
    """Return what SALib's scrambled design says of Ishigami's first index a, which it draws in one scrambling."""
    from SALib.analyze import sobol as analysis
    from SALib.sample import sobol as design

    problem = {"num_vars": 3, "names": list("abc"), "bounds": [[-np.pi, np.pi]] * 3}

    def estimate(seed: int) -> tuple[float, float]:
        points = design.sample(problem, trials, calc_second_order=False, seed=seed)
        values = np.asarray(ishigami(dict(zip("abc", points.T, strict=True))))
        result = analysis.analyze(problem, values, calc_second_order=False, seed=seed)
        return result["S1"][0], result["S1_conf"][0] / 1.96

    estimates = [estimate(seed) for seed in range(repeats)]
    value, error = estimates[0]
    rms = np.sqrt(np.mean([(value - of_ishigami()["Ishigami, first a"]) ** 2 for value, _ in estimates]))
    return (
        f"SALib, Ishigami, first a, {5 * trials:,} evaluations: {with_uncertainty(value, error)}, rms error {rms:.2g}"
    )


def propagated(repeats: int) -> list[list[str]]:
    """Return the median of the trials of adaptive propagations, a row a model."""
    cases: dict[str, tuple[Model, Inputs]] = {
        "sum of four normal inputs": (linear, NORMALS),
        "normal × rectangular": (lambda x: x["a"] * x["b"], {"a": Normal(1.0, 0.1), "b": Rectangular(0.0, 1.0)}),
    }
    table = []
    for name, (model, inputs) in cases.items():
        runs = [
            [propagate_distributions(model, inputs, seed=s, points=points).trials for s in range(repeats)]
            for points in POINTS
        ]
        trials = [int(median(counts)) for counts in runs]
        table.append([name, *(f"{count:,}" for count in trials), f"{trials[0] / trials[1]:.1f}"])
    return table


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.quasi_random", description=__doc__)
    parser.add_argument("--repeats", type=int, default=200, help="seeds of each figure (200)")
    parser.add_argument("--trials", type=int, default=8192, help="trials of each estimate (8192)")
    options = parser.parse_args()
    n, repeats = options.trials, options.repeats
    table = rows(
        of_ishigami(), lambda s, p: first_and_total(sobol(ishigami, ISHIGAMI, trials=n, seed=s, points=p)), repeats
    )
    table += rows(of_linear(), lambda s, p: effects(shapley(linear, NORMALS, trials=n, seed=s, points=p)), repeats)
    print(f"{n:,} trials; Ishigami: {8 * n:,} evaluations, linear: {16 * n:,}; {repeats} repeats")
    head = ["figure", "exact", "random", "quasi-random", "rms error", "rms error", "saves", "held, %", "held, %"]
    print(text_table(head, table))
    print(f"the preset's T1 by central, on sums: six components, {min(repeats, 100)} repeats, rms error in % of 3σ")
    head = ["trials", "figure", *POINTS, "saves", "held, %", "held, %"]
    print(text_table(head, campaign(min(repeats, 100))))
    print(salib(min(repeats, 20), n))
    print(f"what a trial saves, totals, median of the inputs, {min(repeats, 40)} repeats")
    print(text_table(["inputs", "512 trials", "8,192"], many_inputs(min(repeats, 40))))
    print(f"trials until two digits are stable, median of {min(repeats, 20)}")
    print(text_table(["adaptive propagation", *POINTS, "saves"], propagated(min(repeats, 20))))


if __name__ == "__main__":
    main()
