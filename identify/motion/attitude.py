"""The attitude, by integration of the angular velocity."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.regressor import library_of
from identify.rigid_body.rotation import exponential

GAUSS = np.sqrt(3) / 6
"""Distance of the two Gauss points from a step's middle, as a part of the step."""


def attitude(
    omega: Callable[[Float[Array, ""]], Float[Array, "3"]],
    t: Float[Array, " n"],
    start: Float[Array, "3 3"] | None = None,
) -> Float[Array, "n 3 3"]:
    """Return the attitudes R_AB at some instants, by integration of the angular velocity.

    Fourth-order Magnus steps on two Gauss points each (Iserles et al., doi:10.1017/S0962492900002154).

    Args:
        omega: angular velocity in B [rad/s] as a function of time.
        t: instants [s], one after the other.
        start: attitude at the first of them; None: level.
    """
    h = jnp.diff(t)
    middle = (t[1:] + t[:-1]) / 2
    first_omega, second_omega = (jax.vmap(omega)(middle + sign * GAUSS * h) for sign in (-1, 1))
    turn = magnus_turn(first_omega, second_omega, h)
    first = jnp.eye(3, dtype=t.dtype) if start is None else start
    return running_product(jnp.concatenate([first[None], jax.vmap(exponential)(turn)]))


def magnus_turn(first: Any, second: Any, step: Any) -> Any:
    """Return the rotation vectors (n, 3) [rad] of steps (n,) [s], in JAX or in NumPy.

    Args:
        first: angular velocity at each step's first Gauss point (n, 3) [rad/s].
        second: at the second.
        step: durations of the steps [s].
    """
    across = library_of(first, second).cross(first, second)
    return step[:, None] / 2 * (first + second) + (np.sqrt(3) / 12 * step**2)[:, None] * across


def running_product(matrices: Float[Array, "n 3 3"]) -> Float[Array, "n 3 3"]:
    """Return the products of the first 1 … n matrices, in √n rows that are multiplied side by side: √n steps, not n."""
    n = len(matrices)
    size = int(np.ceil(np.sqrt(n)))
    rows = jnp.concatenate([matrices, jnp.broadcast_to(jnp.eye(3, dtype=matrices.dtype), (size * size - n, 3, 3))])

    def advance(product, factor):
        product = product @ factor
        return product, product

    def along(first, steps):
        return jax.lax.scan(advance, first, steps)

    unit = jnp.eye(3, dtype=matrices.dtype)
    ends, within = along(jnp.broadcast_to(unit, (size, 3, 3)), rows.reshape(size, size, 3, 3).swapaxes(0, 1))
    _, before = along(unit, ends)
    before = jnp.concatenate([unit[None], before[:-1]])
    return (before[:, None] @ within.swapaxes(0, 1)).reshape(-1, 3, 3)[:n]
