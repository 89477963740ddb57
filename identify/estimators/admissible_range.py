"""The range of each component of a tensor: among possible bodies, those that the data do not contradict.

A body's second moments ``Σ = ½ tr(I) 1 - I`` are positive semidefinite and linear in the tensor, which is positive
definite and obeys the triangle inequality just then (Wensing, Kim and Slotine 2018, doi:10.1109/LRA.2017.2729659). So
the tensors with ``Σ ⪰ 0`` at a distance ``Q`` from the data of at most ``q`` are a convex set, and its end along any
component is found by Newton steps behind logarithmic barriers (Boyd and Vandenberghe 2004, 11.3).
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import MOMENTS
from identify.rigid_body.pseudo_inertia import SECOND_MOMENT, of_second_moment, second_moment

LARGEST = 1e4
"""Trace of Σ, over that of the data, beyond which a component counts as unbounded."""
BARRIERS = 5.0
"""Parameter of the barriers together: over the weight of the aim, it bounds what is missing to the end."""
ROUNDING = 1e-13
"""Multiple of the unit matrix that is added to a Hessian of unit diagonal against rounding errors."""
SHARPEST = 1e11
"""Last weight of the aim against the barriers."""


class Data(NamedTuple):
    """The data's information on a tensor: ``Q(i) = (i - estimate)ᵀ information (i - estimate)``."""

    estimate: Float[np.ndarray, "6"]
    information: Float[np.ndarray, "6 6"]
    """Inverse covariance, zero where the data say nothing."""

    def distance(self, inertia: Float[np.ndarray, "6"]) -> float:
        """Return the distance Q of a tensor from the data."""
        difference = inertia - self.estimate
        return float(difference @ self.information @ difference)


def nearest(data: Data) -> Float[np.ndarray, "6"]:
    """Return the tensor of a body that is nearest to the data, up to 1e-4 in Q."""
    scale = size(data)
    scaled = Data(data.estimate / scale, data.information * scale**2)
    x = of_second_moment(np.eye(3) / 3)
    for weight in 10.0 ** np.arange(0, 6):
        x = _newton(_sum(_quadratic(scaled, weight), _bodies), x)
    return scale * x


def ends(data: Data, most: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6 2"]:
    """Return the least and the largest value of each component among bodies with Q of at most ``most``; or infinity."""
    scale = size(data)
    scaled, start = Data(data.estimate / scale, data.information * scale**2), nearest(data) / scale
    extremes = np.array(
        [[_farthest(scaled, s * unit, start, q) for s in (-1, 1)] for unit, q in zip(np.eye(6), most, strict=True)]
    )
    values = extremes * [-1, 1]
    values[list(MOMENTS)] = np.maximum(values[list(MOMENTS)], 0)
    return np.where(np.abs(values) > 0.05 * LARGEST, np.copysign(np.inf, values), scale * values)


def size(data: Data) -> float:
    """Return the trace of the positive part of Σ of the estimate [kg·m²]."""
    return float(max(np.linalg.eigvalsh(second_moment(data.estimate)).clip(0).sum(), 1e-30))


def _farthest(data: Data, direction: np.ndarray, start: np.ndarray, most: float) -> float:
    """The largest value along a direction, rounded up by no more than a thousandth of the way there or of the size."""
    x, weight, way = start, 1.0, 0.0
    while BARRIERS / weight > 1e-3 * min(way, 1.0) and weight < SHARPEST:
        weight *= 30
        x = _newton(_sum(_linear(-weight * direction), _bodies, _within(data, most)), x)
        way = float(direction @ (x - start))
    return float(direction @ x) + BARRIERS / weight


_FLAT, _TRACE = SECOND_MOMENT.reshape(6, 9), np.trace(SECOND_MOMENT, axis1=1, axis2=2)

Function = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""Value, gradient and Hessian at a tensor; infinite outside."""


def _sum(*functions: Function) -> Function:
    def total(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        values, gradients, hessians = zip(*(function(x) for function in functions), strict=True)
        return sum(values), sum(gradients), sum(hessians)

    return total


def _linear(slope: np.ndarray) -> Function:
    return lambda x: (float(slope @ x), slope, np.zeros((6, 6)))


def _quadratic(data: Data, weight: float) -> Function:
    half = weight * data.information
    return lambda x: (0.5 * weight * data.distance(x), half @ (x - data.estimate), half)


def _within(data: Data, most: float) -> Function:
    """Return the barrier ``-log(most - Q)`` as a function with its derivatives."""

    def barrier(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        slack = most - data.distance(x)
        if slack <= 0:
            return np.inf, np.zeros(6), np.zeros((6, 6))
        slope = 2 * data.information @ (x - data.estimate) / slack
        return -np.log(slack), slope, 2 * data.information / slack + np.outer(slope, slope)

    return barrier


def _bodies(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """``-log det Σ - log(LARGEST - tr Σ)``."""
    flat = x @ _FLAT
    slack = LARGEST - float(x @ _TRACE)
    corner = flat[0] * flat[4] - flat[1] * flat[3]
    moments = flat.reshape(3, 3)
    if slack <= 0 or flat[0] <= 0 or corner <= 0 or (determinant := float(np.linalg.det(moments))) <= 0:
        return np.inf, np.zeros(6), np.zeros((6, 6))
    trace_slope = _TRACE / slack
    solved = np.linalg.inv(moments) @ SECOND_MOMENT
    slope = trace_slope - np.trace(solved, axis1=1, axis2=2)
    crossed = solved.reshape(6, 9) @ solved.transpose(0, 2, 1).reshape(6, 9).T
    return -math.log(determinant) - math.log(slack), slope, np.outer(trace_slope, trace_slope) + crossed


def _newton(function: Function, x: np.ndarray) -> np.ndarray:
    """The minimum of a self-concordant function, by Newton steps."""
    value, slope, curvature = function(x)
    for _ in range(100):
        scale = 1 / np.sqrt(np.diag(curvature))
        step = -scale * np.linalg.solve(curvature * np.outer(scale, scale) + ROUNDING * np.eye(6), scale * slope)
        decrement = -float(slope @ step)
        if decrement < 1e-4:
            break
        length, rounding = 1.0, 1e-13 * abs(value)
        while not (new := function(x + length * step))[0] <= value - 0.1 * length * decrement + rounding:
            length /= 2
            if length < 1e-12:
                return x
        x, (value, slope, curvature) = x + length * step, new
    return x
