"""Coloured noise from its Allan parameters: white noise, flicker and random walk.

With the two-sided spectrum ``N² + B² / (2π f) + K² / (2π f)²`` of IEEE Std 952-1997, annex C, the Allan variance at
averaging time τ is ``N²/τ + (2 ln 2/π) B² + K² τ/3``.
"""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from rig.toml_tables import WrongKeyError
from uq.sources.draw_figures import figures
from uq.sources.draws import BLOCK
from uq.sources.flicker import DECAYS, FLICKER, pink_block
from uq.sources.noise_filters import WALK, WHITE, NoisePart
from uq.sources.random_normals import Index, drawn_in_turn, normal_pairs
from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source

UNITS = {"white": "{}*s**0.5", "flicker": "{}", "random_walk": "{}/s**0.5"}
"""Units of N, B and K: angle random walk, bias instability and rate random walk of an angular velocity."""


class Memory(NamedTuple):
    """Memory of the noise from block to block."""

    processes: Float[Array, "3 processes"]
    """Values of flicker's first-order processes at the last sample."""
    walk: Float[Array, "3"]
    """Sum of the random walk at the last sample."""


class Coloured(ErrorKind):
    """Adds noise with these Allan parameters; flicker and random walk start from zero at the run's start."""

    name = "coloured"
    targets = SIGNAL_UNITS
    absence = "the noise of {} has neither flicker nor a random walk"
    noise = True
    averages_out = True
    sizes = UNITS

    def keys(self, target: str) -> dict[str, Any]:
        """Return the three parameters, each of which may be missing."""
        units = {name: self.unit_of_size(target, name) for name in UNITS}
        return {name: Annotated[np.ndarray, figures(unit, self.shape, least=0)] | None for name, unit in units.items()}

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the parameters that are stated: nothing is drawn for the others."""
        stated = {name: keys[name] for name in UNITS if keys[name] is not None}
        if not stated:
            raise WrongKeyError("white", f"give {', '.join(UNITS)} or some of them")
        return stated

    def noise_at_rest(self, source: Source, dtype: Any) -> Memory:
        """Return the memory of the run's start."""
        return Memory(jnp.zeros((3, len(DECAYS)), dtype), jnp.zeros(3, dtype))

    def noise_block(
        self, source: Source, memory: Memory, stream: Key[Array, ""], block: Index, rate: Float[Array, ""], dtype: Any
    ) -> tuple[Float[Array, "3 1200"], Memory]:
        """Return the sum of the parts that are stated.

        Flicker is drawn and filtered in float32, which rounds to less than the filter's 3e-6; its memory is not.
        """
        total, (processes, walk) = jnp.zeros((3, BLOCK), dtype), memory
        figure = {name: jnp.asarray(value)[:, None] for name, value in source.settings.items()}
        if "white" in figure:
            total = total + (figure["white"] * jnp.sqrt(rate)).astype(dtype) * _white(stream, block, 0, dtype)
        if "flicker" in figure:
            pink, processes = pink_block(_white(stream, block, 1, np.dtype("float32")), processes)
            total = total + figure["flicker"].astype(dtype) * pink.astype(dtype)
        if "random_walk" in figure:
            sums = walk[:, None] + jnp.cumsum(_white(stream, block, 2, dtype), axis=1)
            total, walk = total + (figure["random_walk"] / jnp.sqrt(rate)).astype(dtype) * sums, sums[:, -1]
        return total, Memory(processes, walk)

    def noise_parts(self, source: Source, rate: float) -> list[NoisePart]:
        """Return white noise, flicker and a running sum, those that are stated."""
        filters = {"white": (WHITE, np.sqrt(rate)), "flicker": (FLICKER, 1.0), "random_walk": (WALK, 1 / np.sqrt(rate))}
        stated = [(filters[name], np.asarray(figure)) for name, figure in source.settings.items() if np.any(figure)]
        return [NoisePart(filter_, factor * figure) for (filter_, factor), figure in stated]

    def white_variance(self, source: Source, rate: float) -> np.ndarray:
        """Return the variance of its white part."""
        return np.square(source.settings.get("white", np.zeros(3))) * rate

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return that flicker and random walk are not white."""
        coloured = any(np.any(source.settings.get(name, 0)) for name in ("flicker", "random_walk"))
        return "is noise that is not white" if coloured else None


def _white(stream: Key[Array, ""], block: Index, number: int, dtype: Any) -> Float[Array, "3 1200"]:
    """Standard normal samples, block by block as all draws."""
    stream, columns = jax.random.fold_in(stream, number), jax.lax.iota(jnp.uint32, BLOCK // 2)
    axis_pairs = lambda row: normal_pairs(stream, block, row * jnp.uint32(BLOCK // 2) + columns, dtype)  # noqa: E731
    pairs = drawn_in_turn(axis_pairs, 3)
    return jnp.concatenate([pairs.real, pairs.imag], axis=1)
