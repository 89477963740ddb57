"""Intervals that cover an expected error which is not corrected (GUM F.2.4.5)."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.results.identification_result import Identification


def covering_bias(result: Identification, bias: Float[np.ndarray, "6"]) -> Identification:
    """Return a result whose interval reaches as much further, on the side where the truth then is, as is expected.

    Args:
        result: its ``interval95`` does not hold this error yet.
        bias: expected error of each component [kg·m²]; NaN counts as none.
    """
    expected = np.nan_to_num(bias)
    ends = np.stack([np.maximum(expected, 0.0), np.minimum(expected, 0.0)], axis=1)
    return replace(result, interval95=result.interval95 - ends)
