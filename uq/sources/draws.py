"""Draws of error sources.

A draw depends on (seed, source name, trial, block) alone: never on the batch size, the number of devices, the other
sources, or where a run was resumed; but sources declared correlated are drawn together.
"""

import zlib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact, Key

from identify.pytree import Pytree, static_field
from uq.sources.distributions import Empirical, Normal, random_point
from uq.sources.noise_filters import NoisePart
from uq.sources.quasi_random import values_at
from uq.sources.random_normals import Index, drawn_in_turn, normal_pairs
from uq.sources.source import Source

BLOCK = 1200
"""Samples in a block of draws; always this, since the draws depend on it."""


class Mixing(Pytree):
    """Normal sources that are correlated: axes of one, or several."""

    names: tuple[str, ...] = static_field()
    axes: tuple[int, ...] = static_field()
    """Number of values that each source draws."""
    correlation: Float[Array | np.ndarray, "k k"]
    """Correlation of all drawn values, in the order of the names."""

    @property
    def places(self) -> dict[str, slice]:
        """Places of each source's values among all of them."""
        ends = np.cumsum(self.axes).tolist()
        return {name: slice(end - n, end) for name, n, end in zip(self.names, self.axes, ends, strict=True)}

    def mixed(self, drawn: Mapping[str, Inexact[Array, "..."]]) -> dict[str, Inexact[Array, "..."]]:
        """Return independent standard normal draws, made correlated; axes lead, other sources stay as they are.

        Two draws may come in a complex number's parts.
        """
        here = [name for name in self.names if name in drawn]
        if not here:
            return dict(drawn)
        rows = [drawn[name].reshape(axes, -1) for name, axes in zip(self.names, self.axes, strict=True) if name in here]
        joint = self._root(here).astype(rows[0].dtype) @ jnp.concatenate(rows)
        parts = jnp.split(joint, np.cumsum([len(row) for row in rows])[:-1])
        return {**drawn, **{name: part.reshape(drawn[name].shape) for name, part in zip(here, parts, strict=True)}}

    def _root(self, here: Sequence[str]) -> Float[Array, "k k"]:
        """The triangular root of the correlations of those that are here; nearly so if some go together wholly."""
        index = np.r_[tuple(self.places[name] for name in here)]
        small = 16 * float(jnp.finfo(float).eps)
        root = jnp.linalg.cholesky(jnp.asarray(self.correlation)[np.ix_(index, index)] + small * jnp.eye(len(index)))
        return root / jnp.linalg.norm(root, axis=1, keepdims=True)


def mixed(drawn: dict[str, Array], mixing: Sequence[Mixing]) -> dict[str, Array]:
    """Return draws by name, correlated as declared."""
    for mix in mixing:
        drawn = mix.mixed(drawn)
    return drawn


def stream_number(name: str) -> int:
    """Return the number of a source's random stream: a hash of its name that never changes (CRC-32)."""
    return zlib.crc32(name.encode())


def stream_key(key: Key[Array, ""], number: Index | Array, trial: Index) -> Key[Array, ""]:
    """Return the key of a stream in a trial: the stream's number and the trial, folded into the seed's key."""
    return jax.random.fold_in(jax.random.fold_in(key, number), trial)


def constant_key(key: Key[Array, ""], number: Index | Array, trial: Index) -> Key[Array, ""]:
    """Return the key of a constant source's one draw in a trial: that of the stream's first block."""
    return jax.random.fold_in(stream_key(key, number, trial), 0)


def draw_constants(
    sources: Sequence[Source], mixing: Sequence[Mixing], key: Key[Array, ""], trial: Index, dtype: Any
) -> dict[str, Float[Array, "..."]]:
    """Return the one draw of each constant source of a trial, in SI, by name."""
    constant = sorted((source for source in sources if source.constant), key=lambda source: source.name)
    if not constant:
        return {}
    counts = [source.shape.coordinates(np.shape(source.sigma)) for source in constant]
    numbers = jnp.asarray([stream_number(source.name) for source in constant], jnp.uint32)
    keys = jax.vmap(lambda number: constant_key(key, number, trial))(numbers)
    # one loop, each point as long as the longest, which changes no number: so XLA compiles the generator once
    points = jax.lax.map(lambda key: random_point(key, max(counts), dtype), keys)
    parts = [point[:count] for point, count in zip(points, counts, strict=True)]
    return constants_at(constant, mixing, jnp.concatenate(parts))


def constants_at(
    sources: Sequence[Source], mixing: Sequence[Mixing], point: Float[Array, " coordinates"]
) -> dict[str, Float[Array, "..."]]:
    """Return each constant source's value at a point of the open unit cube, in SI, by name: of a quasi-random trial."""
    constant = [source for source in sources if source.constant]
    shapes = {source.name: np.shape(source.sigma) for source in constant}
    drawn = mixed(values_at({source.name: source.shape for source in constant}, point, shapes), mixing)
    in_si = lambda x: jnp.asarray(x, point.dtype)  # noqa: E731
    return {s.name: in_si(s.mean) + in_si(s.sigma) * drawn[s.name] for s in constant}


def constant_coordinates(sources: Sequence[Source]) -> int:
    """Return how many coordinates :func:`constants_at` takes."""
    return sum(source.shape.coordinates(np.shape(source.sigma)) for source in sources if source.constant)


def noise_streams(sources: Sequence[Source], key: Key[Array, ""], trial: Index) -> list[Key[Array, ""]]:
    """Return the key of each source's noise in a trial: to be derived once, not for every block."""
    return [stream_key(key, stream_number(source.name), trial) for source in sources]


def draw_pairs(
    sources: Sequence[Source], mixing: Sequence[Mixing], streams: Sequence[Key[Array, ""]], block: Index, dtype: Any
) -> list[Complex[Array, "3 600"]]:
    """Return the draws of precision sources for one block of samples of a trial, component first, as complex numbers.

    Real parts are the first half of the block, imaginary parts the second: what the generator makes, not yet in order.
    """
    pairs = {s.name: _standard_pairs(s, stream, block, dtype) for s, stream in zip(sources, streams, strict=True)}
    drawn = mixed(pairs, mixing)
    return [_scaled(drawn[s.name], s.sigma) for s in sources]


def noise_at_rest(sources: Sequence[Source], dtype: Any) -> list[Any]:
    """Return what the filters of each source's noise remember at the run's start, for :func:`noise_of_block`."""
    return [() if s.white else [part.filter.at_rest(dtype) for part in _noise_parts(s, 1.0)] for s in sources]


def _noise_parts(source: Source, rate: Any) -> Sequence[NoisePart]:
    """The parts of noise with a memory, whose figures may be traced."""
    return source.error_kind.noise_parts(source, rate) or ()


def noise_of_block(
    sources: Sequence[Source],
    mixing: Sequence[Mixing],
    streams: Sequence[Key[Array, ""]],
    memory: Sequence[Any],
    block: Index,
    rate: Float[Array, ""],
    dtype: Any,
) -> tuple[list[Inexact[Array, "3 _"]], list[Any]]:
    """Return one block of every source's noise, and what the sources remember of it.

    White noise comes as :func:`draw_pairs` makes it, other noise in order:
    :func:`uq.sources.random_normals.in_order` takes both.

    Args:
        sources: of noise, white or not.
        mixing: what is correlated.
        streams: key of each, from :func:`noise_streams`.
        memory: of each, from the block before; of the first from :func:`noise_at_rest`.
        block: number of the block.
        rate: sample rate [Hz].
        dtype: of the samples.
    """
    white = [(source, stream) for source, stream in zip(sources, streams, strict=True) if source.white]
    pairs = iter(draw_pairs([s for s, _ in white], mixing, [stream for _, stream in white], block, dtype))
    drawn, remembered = [], []
    for source, stream, before in zip(sources, streams, memory, strict=True):
        if source.white:
            drawn.append(next(pairs))
            remembered.append(before)
            continue
        noise, after = jnp.zeros((3, BLOCK), dtype), []
        for part, state in zip(_noise_parts(source, rate), before, strict=True):
            driving = partial(_white, jax.random.fold_in(stream, part.stream), block)
            samples, state = part.filter.block(driving, state, dtype)
            noise = noise + jnp.asarray(part.sigma).astype(dtype)[:, None] * samples.astype(dtype)
            after.append(state)
        drawn.append(noise)
        remembered.append(after)
    return drawn, remembered


def _white(stream: Key[Array, ""], block: Index, dtype: Any) -> Float[Array, "3 1200"]:
    """Standard normal samples in order, axis by axis."""
    columns = jax.lax.iota(jnp.uint32, BLOCK // 2)
    axis_pairs = lambda row: normal_pairs(stream, block, row * jnp.uint32(BLOCK // 2) + columns, dtype)  # noqa: E731
    pairs = drawn_in_turn(axis_pairs, 3)
    return jnp.concatenate([pairs.real, pairs.imag], axis=1)


def _standard_pairs(source: Source, stream: Key[Array, ""], block: Index, dtype: Any) -> Complex[Array, "3 600"]:
    if not isinstance(source.shape, Normal):
        drawn = _standard_block(source, jax.random.fold_in(stream, block), dtype)
        return jax.lax.complex(drawn[:, : BLOCK // 2], drawn[:, BLOCK // 2 :])
    row, column = (jax.lax.broadcasted_iota(jnp.uint32, (3, BLOCK // 2), axis) for axis in (0, 1))
    pairs = normal_pairs(stream, block, row * jnp.uint32(BLOCK // 2) + column, dtype)
    mean = jnp.broadcast_to(jnp.asarray(source.shape.mean, dtype), (3,))[:, None]
    return _scaled(pairs, source.shape.standard_deviation) + jax.lax.complex(mean, mean)


def _scaled(pairs: Complex[Array, "3 n"], by: Any) -> Complex[Array, "3 n"]:
    factor = jnp.broadcast_to(jnp.asarray(by, pairs.real.dtype), (3,))[:, None]
    return jax.lax.complex(factor * pairs.real, factor * pairs.imag)


def _standard_block(source: Source, key: Key[Array, ""], dtype: Any) -> Float[Array, "3 1200"]:
    if isinstance(source.shape, Empirical) and np.ndim(source.shape.samples) == 2:  # rows: axes that go together
        return source.shape.draw(key, (BLOCK, 3), dtype).T
    return source.shape.draw(key, (3, BLOCK), dtype)
