"""Check that JAX computes in float64, which only the application may switch on."""

import warnings

import jax

MESSAGE = (
    "computed in float32, because JAX's float64 is off: run jax.config.update('jax_enable_x64', True) first, "
    "or ask for dtype='float32'"
)


class PrecisionWarning(UserWarning):
    """A public function was called without float64 and float32 was not asked for."""


def check_precision(dtype: str) -> list[str]:
    """Warn if float64 is asked for but off; return the warnings for the result.

    Args:
        dtype: ``"float64"`` or ``"float32"``.

    Raises:
        ValueError: another type is asked for.
    """
    if dtype not in ("float32", "float64"):
        raise ValueError(f"Argument `dtype` must be 'float64' or 'float32', but is {dtype!r}.")
    if dtype == "float32" or jax.config.read("jax_enable_x64"):
        return []
    warnings.warn(MESSAGE, PrecisionWarning, stacklevel=3)
    return [MESSAGE]
