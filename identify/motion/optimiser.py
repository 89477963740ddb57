"""Minimise a smooth function under thousands of smooth limits: an augmented Lagrangian with L-BFGS inside.

Conn, Gould, Toint, SIAM J. Numer. Anal. 28 (1991) 545, doi:10.1137/0728030, for inequalities with Rockafellar's
multiplier function, whose mean over the limits is used so that a finer grid changes nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

Goal = Callable[[Float[Array, " u"]], tuple[Float[Array, ""], Float[Array, " m"]]]
"""Function that returns the value to be made small, and the limits, which are met where they are at most zero."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """End of a minimisation."""

    unknowns: Float[np.ndarray, " u"]
    goal: float
    """Value of the goal at the end of the minimisation."""
    excess: float
    """Largest violation of a limit; at most zero: all are met."""
    evaluations: int
    """Number of evaluations of function and gradient."""


class Lagrangian:
    """Goal and limits as one smooth function of the unknowns, given multipliers and penalty; compiled once."""

    def __init__(self, goal: Goal):
        def value(unknowns, multipliers, penalty):
            objective, limits = goal(unknowns)
            raised = jnp.maximum(multipliers + penalty * limits, 0.0)
            return objective + ((raised**2 - multipliers**2) / (2 * penalty)).mean(), (objective, limits)

        self.goal = goal
        self.gradient: Any = jax.jit(jax.value_and_grad(value, has_aux=True))

    def at(self, unknowns: np.ndarray, multipliers: np.ndarray, penalty: float) -> tuple[float, np.ndarray]:
        """Return value and gradient for the inner minimisation."""
        (value, _), slope = self.gradient(jnp.asarray(unknowns), multipliers, penalty)
        return float(value), np.asarray(slope)

    def parts(self, unknowns: np.ndarray, multipliers: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the goal and the limits."""
        (_, (objective, limits)), _ = self.gradient(jnp.asarray(unknowns), multipliers, 1.0)
        return float(objective), np.asarray(limits)


def minimise(
    lagrangian: Lagrangian,
    start: Float[np.ndarray, " u"],
    *,
    rounds: int = 12,
    steps: int = 150,
    penalty: float = 300.0,
    growth: float = 2.5,
    heaviest: float = 1e6,
    progress: Callable[[int, float, float], None] | None = None,
) -> Optimum:
    """Minimise from a start.

    Args:
        lagrangian: of the goal and its limits.
        start: unknowns, feasible or not.
        rounds: updates of the multipliers.
        steps: of L-BFGS in each.
        penalty: on violations, at first.
        growth: of the penalty from round to round, up to ``heaviest``.
        heaviest: largest penalty.
        progress: called after each round with its number, the goal and the largest violation.
    """
    unknowns = np.asarray(start, float)
    multipliers, evaluations = np.zeros(jax.eval_shape(lagrangian.goal, unknowns)[1].shape), 0
    for number in range(rounds):
        result: Any = scipy.optimize.minimize(
            lagrangian.at, unknowns, (multipliers, penalty), jac=True, method="L-BFGS-B",
            options={"maxiter": steps, "maxcor": 30},
        )  # fmt: skip
        unknowns, evaluations = result.x, evaluations + result.nfev
        objective, limits = lagrangian.parts(unknowns, multipliers)
        multipliers = np.maximum(multipliers + penalty * limits, 0.0)
        penalty = min(penalty * growth, heaviest)
        if progress is not None:
            progress(number + 1, objective, float(limits.max()))
    return Optimum(unknowns, objective, float(limits.max()), evaluations)
