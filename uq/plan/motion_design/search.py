"""Steps of both searches: checks of options, minimisation from several starts, the largest size that meets limits."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.optimiser import Lagrangian, Optimum, minimise
from rig.exceptions import listed, quoted
from uq.files.mistakes import ExperimentError
from uq.progress_bar import Progress


def check_options(
    choices: Mapping[str, tuple[str, Sequence[str]]], counts: Mapping[str, int], seconds: Mapping[str, float | None]
) -> None:
    """Refuse what is none of its choices, fewer than one, or a time that is not above zero; None is not given.

    Raises:
        ExperimentError: the first of them.
    """
    for name, (given, allowed) in choices.items():
        if given not in allowed:
            raise ExperimentError(f"unknown {name} {quoted(given)}: choose one of {listed(allowed)}")
    for name, count in counts.items():
        if count < 1:
            raise ExperimentError(f"{count} {name}: ask for one at least")
    for name, time in seconds.items():
        if time is not None and not 0 < time < np.inf:
            raise ExperimentError(f"a {name} of {time:g} s: give seconds above zero")


def optima(
    lagrangian: Lagrangian,
    starts: Mapping[int, Float[np.ndarray, " u"]],
    tell: Progress,
    *,
    asked: int,
    rounds: int,
    steps: int,
    heaviest: float = 1e6,
) -> list[Optimum]:
    """Minimise from each start.

    Args:
        lagrangian: goal under limits, compiled once for all starts.
        starts: unknowns by the start's number, from 0.
        tell: called with the rounds done and the rounds of all starts.
        asked: number of all starts.
        rounds: of the minimisation from each start.
        steps: in each round, at most.
        heaviest: largest penalty.
    """

    def from_start(number: int, start: np.ndarray) -> Optimum:
        def progress(done: int, *_: float) -> None:
            tell("starts", number * rounds + done, asked * rounds)

        progress(0)
        return minimise(lagrangian, start, rounds=rounds, steps=steps, heaviest=heaviest, progress=progress)

    return [from_start(number, start) for number, start in starts.items()]


def bisected(met: Callable[[float], bool], halvings: int, low: float = 0.0, high: float = 1.0) -> float:
    """Return the largest size between two, if all smaller ones are met as the low one is, and the high one is not."""
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (middle, high) if met(middle) else (low, middle)
    return low


def in_pieces(function: Callable[[Any], Any], motion: Any, size: int) -> Any:
    """Return what a function of a motion returns, instants first, in NumPy: computed in pieces of one size.

    The last piece is filled up with its last instant, so that runs of all lengths are compiled once.
    """
    count = len(jax.tree.leaves(motion)[0])
    filled = jax.tree.map(lambda x: np.concatenate([x, np.repeat(x[-1:], -count % size, axis=0)]), motion)
    pieces: list[Any] = []
    for first in range(0, count, size):
        piece = jax.tree.map(lambda x, first=first: jnp.asarray(x[first : first + size]), filled)
        pieces.append(jax.tree.map(np.asarray, function(piece)))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *pieces)
