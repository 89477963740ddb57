"""Batches of a function of many samples: one after the other on a processor, whose cache holds one of them."""

from collections.abc import Callable
from typing import Any

import jax


def one_at_a_time(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a pure function of arrays that ``jax.vmap`` maps by ``jax.lax.map`` on a processor, and at once elsewhere.

    Side by side, the signals of a batch fill the memory's width instead of the cache: a batch then takes three times as
    long as its members. Derivatives are those of the function itself, whose batches lie side by side.

    Args:
        function: of arrays alone; it does not depend on what was batched.
    """

    @jax.custom_batching.custom_vmap
    def single(*arrays: Any) -> Any:
        return function(*arrays)

    @single.def_vmap
    def batched(size: int, is_batched: list[bool], *arrays: Any) -> tuple[Any, bool]:
        places = [place for place, moves in enumerate(is_batched) if moves]

        def with_rest(called: Callable[..., Any]) -> Callable[..., Any]:
            def member(moving: list[Any]) -> Any:
                every = dict(enumerate(arrays)) | dict(zip(places, moving, strict=True))
                return called(*every.values())

            return member

        moving, at_once = [arrays[place] for place in places], jax.vmap(with_rest(function))
        if any(jax.typeof(array).sharding.spec[0] is not None for array in moving):  # over devices, as is stated
            results = at_once(moving)
        else:
            in_turn = lambda moving: jax.lax.map(with_rest(single), moving)  # noqa: E731 - mapped again, if batched again
            results = jax.lax.platform_dependent(moving, cpu=in_turn, default=at_once)
        return results, jax.tree.map(lambda _: True, results)

    differentiable = jax.custom_jvp(single)
    differentiable.defjvp(lambda arrays, tangents: jax.jvp(function, arrays, tangents))
    return differentiable
