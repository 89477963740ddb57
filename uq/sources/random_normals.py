"""Standard normal numbers, two from each turn of a counter-based generator: the time of a trial is mostly theirs.

The generator is Threefry-2x32 with 20 rounds (doi:10.1145/2063384.2063405), the one of ``jax.random``, written out so
that its two words are computed together with what is made of them. The Box–Muller transform takes one word for the
radius and one for the angle: the largest number is 6.7, which one draw in 7e10 would exceed.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Inexact, Int, Key, UInt32

Index = Int[Array, ""] | int
"""Number of a trial, of a block, of an estimator."""

ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
PARITY = 0x1BD11BDA
SERIES = {"float32": 5, "float64": 9}
"""Terms of the series of sine and cosine up to 45° that the precision asks for."""

Word = UInt32[Array, "*shape"]


def threefry(key: tuple[Word, Word], counter: tuple[Word, Word]) -> tuple[Word, Word]:
    """Return the two words of Threefry-2x32 with 20 rounds; key and counter broadcast."""
    keys = (*key, key[0] ^ key[1] ^ jnp.uint32(PARITY))
    left, right = counter[0] + keys[0], counter[1] + keys[1]
    for group in range(5):
        for turn in ROTATIONS[group % 2]:
            left = left + right
            right = left ^ ((right << jnp.uint32(turn)) | (right >> jnp.uint32(32 - turn)))
        left = left + keys[(group + 1) % 3]
        right = right + keys[(group + 2) % 3] + jnp.uint32(group + 1)
    return left, right


def normal_pairs(
    key: Key[Array, ""], block: Int[Array, ""] | int, place: UInt32[Array, "*shape"], dtype: Any
) -> Complex[Array, "*shape"]:
    """Return independent standard normal numbers, two in each complex one, in real and imaginary part.

    Args:
        key: of the stream; a number depends on it, on the block and on its place alone.
        block: number of the block.
        place: numbers of the places in the block.
        dtype: float32 or float64 of each part.
    """
    left, right = jax.random.key_data(key)
    zero = jnp.zeros_like(place)
    words = threefry((left + zero, right + zero), (jnp.asarray(block).astype(jnp.uint32) + zero, place))
    return box_muller(*words, dtype)


def normals_of_keys(keys: Key[Array, " trials"], count: int) -> Float[Array, "count trials"]:
    """Return independent standard normal numbers of each key, side by side; see :func:`normal_pairs`."""
    dtype = jnp.result_type(float)  # float32 without float64
    place_pairs = lambda place: jax.vmap(lambda key: normal_pairs(key, 0, place, dtype))(keys)  # noqa: E731
    pairs = drawn_in_turn(place_pairs, -(-count // 2))
    return jnp.concatenate([pairs.real, pairs.imag])[:count]


def drawn_in_turn(draw: Callable[[UInt32[Array, ""]], Complex[Array, "*shape"]], count: int) -> Array:
    """Return the pairs of ``draw(0)``, ``draw(1)`` …, leading.

    In a loop, whose results the compiler keeps: else it computes all twice, for real and imaginary parts.
    """
    return jax.lax.map(draw, jnp.arange(count, dtype=jnp.uint32))


def box_muller(radius: Word, angle: Word, dtype: Any) -> Complex[Array, "..."]:
    """Return two standard normal numbers, in a complex one, from two words of 32 random bits."""
    dtype = jnp.dtype(dtype)
    uniform = (radius.astype(dtype) + dtype.type(0.5)) * dtype.type(2.0**-32)
    length = jnp.sqrt(-2 * (_log(uniform) if dtype == jnp.float64 else jnp.log(uniform)))
    sine, cosine = _sine_and_cosine(jax.lax.bitcast_convert_type(angle << jnp.uint32(2), jnp.int32).astype(dtype))
    swapped = (angle >> jnp.uint32(30)) & jnp.uint32(1) != 0
    length = jnp.where(angle >> jnp.uint32(31) != 0, -length, length)
    return jax.lax.complex(length * jnp.where(swapped, cosine, sine), length * jnp.where(swapped, sine, cosine))


def in_order(*noise: Inexact[Array, "k _"]) -> Float[Array, "k m"]:
    """Return samples side by side; of pairs the real parts, then the imaginary ones."""
    return joined([half for x in noise for half in ((x.real, x.imag) if jnp.iscomplexobj(x) else (x,))])


def joined(parts: Sequence[Array], axis: int = 1) -> Array:
    """Return what ``concatenate`` does, each part written into its place: of that, XLA makes fast loops on a CPU."""
    shape = list(parts[0].shape)
    shape[axis] = sum(part.shape[axis] for part in parts)
    concatenated, start = jnp.zeros(shape, parts[0].dtype), 0
    for part in parts:
        concatenated = jax.lax.dynamic_update_slice_in_dim(concatenated, part, start, axis)
        start += part.shape[axis]
    return concatenated


def _log(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """Natural logarithm of normal float64 numbers in arithmetic that goes through vector units; 1e-15 of itself."""
    bits = jax.lax.bitcast_convert_type(x, jnp.int64)
    exponent = (bits - np.float64(math.sqrt(0.5)).view(np.int64)) >> np.int64(52)
    mantissa = jax.lax.bitcast_convert_type(bits - (exponent << np.int64(52)), jnp.float64)  # √½ … √2
    ratio = (mantissa - 1) * (1 / (mantissa + 1))  # of a quotient with two uses, XLA draws the random word twice
    series = _polynomial(ratio * ratio, [2 / (2 * k + 1) for k in range(11)])
    return exponent.astype(jnp.int32).astype(jnp.float64) * math.log(2) + ratio * series


def _sine_and_cosine(angle: Float[Array, "..."]) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
    """Return sine and cosine of ±45° for an angle of ±2³¹."""
    turn = angle * angle.dtype.type(math.pi / 2 * 2.0**-32)
    factorial = [(-1) ** (k // 2) / math.factorial(k) for k in range(2 * SERIES[angle.dtype.name])]
    square = turn * turn
    return turn * _polynomial(square, factorial[1::2]), _polynomial(square, factorial[0::2])


def _polynomial(x: Float[Array, "..."], coefficients: Sequence[float]) -> Float[Array, "..."]:
    """Return the value of a polynomial, coefficients of ascending powers."""
    result = jnp.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        result = result * x + x.dtype.type(coefficient)
    return result
