"""The study of noise from a still recording: intervals of 95 % of N, B, K and drift against what was put in.

The simulator shares nothing with the engine's: flicker is white noise shaped in the frequency domain, over a period of
eight times the recording.

    python -m tests.helpers.noise_study --runs 200
"""

import argparse
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from identify.signals.allan_noise import MISFIT, PARAMETERS, allan_noise

RATES = (100.0, 200.0, 400.0)
SECONDS = (60.0, 200.0, 600.0)


class Truth(NamedTuple):
    """What a channel was made of, in units of the signal."""

    values: np.ndarray
    """N, B and K."""
    drift: float


def simulated(truth: Truth, rate: float, n: int, generator: np.random.Generator) -> np.ndarray:
    """A channel at rest, from its spectrum."""
    white, flicker, walk = truth.values
    signal = white * np.sqrt(rate) * generator.standard_normal(n)
    signal += walk / np.sqrt(rate) * np.cumsum(generator.standard_normal(n))
    long = 8 * n
    lines = np.fft.rfft(generator.standard_normal(long))
    frequency = np.fft.rfftfreq(long, 1 / rate)
    lines[1:] *= flicker * np.sqrt(rate / (2 * np.pi * frequency[1:]))
    lines[0] = 0
    return signal + np.fft.irfft(lines, long)[:n] + truth.drift * np.arange(n) / rate


def drawn(generator: np.random.Generator) -> tuple[Truth, float, int]:
    """A channel with its rate and number of samples: white and flicker alike at 0.02 to 2 Hz, flicker and walk below."""
    rate, seconds = generator.choice(RATES), generator.choice(SECONDS)
    white = 10 ** generator.uniform(-4, -1)
    corner = 10 ** generator.uniform(-1.7, 0.3)
    below = corner * 10 ** generator.uniform(-2.0, -0.5)
    flicker = white * np.sqrt(2 * np.pi * corner)
    walk = flicker * np.sqrt(2 * np.pi * below)
    return (
        Truth(np.array([white, flicker, walk]), walk * generator.normal() / np.sqrt(seconds)),
        rate,
        int(rate * seconds),
    )


def channels(runs: int, seed: int) -> Iterator[dict[str, object]]:
    """What the fit says of each axis of each recording."""
    for run in range(runs):
        generator = np.random.default_rng([seed, run])
        for _ in range(3):
            truth, rate, n = drawn(generator)
            noise = allan_noise(simulated(truth, rate, n, generator), rate)
            low, high = noise.interval95.T
            yield {
                "inside": (low <= truth.values) & (truth.values <= high),
                "drift": abs(noise.drift - truth.drift) <= 1.96 * noise.drift_uncertainty,
                "seen": low > 0,
                "misfit": noise.misfit > MISFIT or noise.band[1] < 0.44 * rate,
                "width": (high - low) / 2 / truth.values,
                "lines": len(noise.lines),
            }  # fmt: skip


def main() -> None:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rows = list(channels(arguments.runs, arguments.seed))
    column = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    for k, name in enumerate(PARAMETERS):
        inside, seen = column["inside"][:, k], column["seen"][:, k]
        width = np.median(column["width"][seen, k])
        print(
            f"{name:12s} {100 * inside.mean():5.1f} % of {len(inside)}; seen in {100 * seen.mean():.0f} %, ± {100 * width:.1f} %"
        )
    print(f"{'drift':12s} {100 * column['drift'].mean():5.1f} % of {len(rows)}")
    print(f"{'N, B, K':12s} {100 * column['inside'].mean():5.1f} % of {3 * len(rows)}")
    print(f"other shape: {column['misfit'].sum()} of {len(rows)}; false lines: {column['lines'].sum()}")


if __name__ == "__main__":
    main()
