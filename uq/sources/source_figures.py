"""Figures of a ``[[source]]`` in SI: in the unit of what errs, in the shape of its draw; the strictest of several."""

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rounding import significant
from rig.toml_tables import read_value, written
from uq.files.schema import in_unit, quantity_schema, vector_schema


def part_of(unit: str) -> float:
    """Return how many of the SI unit one of ``unit`` is: what is written in per cent counts as parts of one."""
    return 0.01 if unit == "%" else 1.0


def on_axes(figures: Any) -> str:
    """Return figures of the axes as text; one where all are the same."""
    texts = [figure if isinstance(figure, str) else significant(figure) for figure in np.ravel(figures)]
    return texts[0] if len(set(texts)) == 1 else ", ".join(texts)


def figures(
    unit: str, shape: tuple[int, ...], *, above: float | int = -math.inf, least: float | int = -math.inf
) -> Any:
    """Return the annotation of figures in SI that are written in ``unit``: one an axis or one for all axes, or one.

    Args:
        unit: unit of the figures; relative ones are read in per cent.
        shape: (3,) or ().
        above: what each must exceed.
        least: what none may fall below.
    """
    figure: Any = Annotated[float, in_unit(unit, above=above, least=least)]

    def read(path: str, raw: Any) -> np.ndarray:
        is_vector = shape and not isinstance(raw, str)
        values = np.array(read_value(path, raw, tuple[figure, figure, figure] if is_vector else figure))
        return np.full(shape, values * part_of(unit))

    scalar, vector = quantity_schema(unit), vector_schema(unit)
    either = {"title": f"value or vector in {unit}", "anyOf": [vector, scalar]}
    return written(read, either if shape else scalar)


def strictest(
    stated: Sequence[Any], acting: Sequence[Any], choose: Callable[..., Array], without: Float[Array, "3 1"]
) -> Float[Array, "3 1"]:
    """Return which of several sources' figures counts on each axis: the least or the largest of those that act.

    Args:
        stated: figures of each source, one an axis.
        acting: whether each source acts: a truth value, often traced.
        choose: the least or the largest of two.
        without: what counts when no source acts.
    """
    counting = without
    for figure, acts in zip(stated, acting, strict=True):
        counting = jnp.where(acts, choose(counting, jnp.asarray(figure, without.dtype)[:, None]), counting)
    return counting
