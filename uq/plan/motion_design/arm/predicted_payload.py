"""The uncertainty predicted for a payload: ten parameters by force and moment under the declared white noise."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.serial_arm.payload_information import about_cg, about_q, covariance_about_cg, information
from identify.motion.serial_arm.serial_chain import LinkMotion
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import wrench_regressor
from uq.analysis.propagation.inputs import constants_of, inputs_of_cases
from uq.analysis.propagation.uncovered_sources import ANYWHERE
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import typical_errors
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.gram_sums.error_maps import cell_map
from uq.sources.constant_errors import unravel


class WrenchNoise(NamedTuple):
    """The declared white noise of force and moment."""

    covariance: Float[np.ndarray, "6 6"]
    """Covariance of force and moment at one sample [N², N²·m, N²·m²]."""
    left_out: tuple[str, ...]
    """Names of the sources that it does not hold."""


def declared_noise(experiment: Experiment, rate: float) -> WrenchNoise:
    """Return the white noise of force and moment at a sample rate [Hz].

    Raises:
        ExperimentError: force or moment have none, or a source that the law cannot take.
    """
    counted = frozenset(s.name for s in experiment.sources if s.white and not s.of_gyro)
    constants = constants_of(experiment.sources, experiment.mixing)
    cases = [Case("noise", counted)]
    inputs = inputs_of_cases(cases, constants, experiment.sources, experiment.mixing, rate, ANYWHERE)
    covariance = np.asarray(inputs.wrench[0])
    if np.linalg.eigvalsh(covariance / np.maximum(np.diag(covariance).max(), 1e-300))[0] <= 1e-12:
        raise ExperimentError(
            "no white noise of every force and moment among the sources: add [[source]] of kind precision for F and M"
        )
    return WrenchNoise(covariance, tuple(s.name for s in experiment.sources if s.name not in counted))


def ten_parameters(motion: LinkMotion, samples: Float[Array, " t"], noise: Array, body: Body) -> Float[Array, "10 10"]:
    """Return the covariance of mass, r_CG from Q and tensor about the centre of gravity that a motion promises.

    Args:
        motion: of the tool, instants first.
        samples: number that every instant stands for.
        noise: covariance of force and moment at one sample.
        body: the payload.
    """
    body = jax.tree.map(jnp.asarray, body)
    return covariance_about_cg(information(motion, samples, noise), body)


_compiled = jax.jit(ten_parameters)


def promised(
    motion: LinkMotion, samples: Float[np.ndarray, " t"], noise: WrenchNoise, body: Body
) -> Float[np.ndarray, "10 10"]:
    """Return :func:`ten_parameters` of a motion that is there, in NumPy."""
    arrays = jax.tree.map(jnp.asarray, (motion, samples, noise.covariance, body))
    return np.asarray(_compiled(*arrays))


def by_undeclared(motion: LinkMotion, noise: WrenchNoise, experiment: Experiment) -> Float[np.ndarray, "10 10"]:
    """Return the covariance by errors of the load cell that the experiment does not declare, at typical size.

    They change the wrench in proportion to itself, so that no duration averages them; the estimate follows linearly.

    Args:
        motion: of the tool, instants first, at equal intervals.
        noise: by which force and moment are weighed.
        experiment: the payload, sources and typical figures.
    """
    rows = np.asarray(jax.vmap(wrench_regressor)(*map(jnp.asarray, motion)))
    payload = about_q(experiment.body)
    wrench = rows @ np.asarray(payload)
    force, moment = np.abs(wrench).reshape(-1, 2, 3).max(axis=(0, 2)).tolist()
    errors = typical_errors(experiment, (force, moment))
    drawn = constants_of(errors.sources, errors.mixing)
    cell = jax.jacfwd(lambda numbers: cell_map(unravel(drawn.errors @ numbers)))(jnp.zeros(len(drawn.sigma)))
    centred, weights = rows - rows.mean(axis=0), np.linalg.inv(noise.covariance)
    change = np.einsum("tji,jk,klm,tl->im", centred, weights, cell, wrench, optimize=True)
    normal = np.einsum("tji,jk,tkl->il", centred, weights, centred, optimize=True)
    effect = np.asarray(jax.jacfwd(about_cg)(payload)) @ np.linalg.solve(normal, change)
    (covariance,) = drawn.covariance(np.ones((1, len(drawn.sigma))))
    return effect @ covariance @ effect.T
