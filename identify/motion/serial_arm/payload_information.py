"""Information of a wrist sensor on a payload: ten inertial parameters from force and moment under white noise.

The wrench about Q is linear in mass, first moment and the tensor about Q (:func:`wrench_regressor`). By Gauss and
Markov no unbiased linear estimate has a smaller covariance than the inverse of the information, here after the
sensor's constant offsets, which are estimated along: gravity tells mass and first moment only as far as it turns in B.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.serial_arm.serial_chain import LinkMotion
from identify.rigid_body.inertia import Body, parallel_axis
from identify.rigid_body.regressor import wrench_regressor


def information(
    motion: LinkMotion, samples: Float[Array, " t"], wrench_noise: Float[Array | np.ndarray, "6 6"]
) -> Float[Array, "10 10"]:
    """Return the information of (m, m r, tensor about Q) in SI, the six offsets of the wrench being unknown too.

    ``J = Σ Yᵀ S⁻¹ Y - (ΣY)ᵀ S⁻¹ (ΣY) / n``.

    Args:
        motion: of the tool at t instants, instants first.
        samples: number that every instant stands for; their sum is n.
        wrench_noise: covariance S of force and moment at one sample [N², N²·m, N²·m²].
    """
    rows = jax.vmap(wrench_regressor)(*motion)
    weights = jnp.linalg.inv(jnp.asarray(wrench_noise))
    summed = jnp.einsum("t,tij->ij", samples, rows)
    total = jnp.einsum("t,tij,ik,tkl->jl", samples, rows, weights, rows)
    return total - summed.T @ weights @ summed / samples.sum()


def about_cg(parameters: Float[Array, "10"]) -> Float[Array, "10"]:
    """Return (m, r_cg, tensor about the centre of gravity) from (m, m r, tensor about Q)."""
    mass, r_cg = parameters[0], parameters[1:4] / parameters[0]
    return jnp.concatenate([mass[None], r_cg, parallel_axis(parameters[4:], -mass, r_cg)])


def about_q(body: Body) -> Float[Array, "10"]:
    """Return (m, m r, tensor about Q) of a body, in which its wrench is linear."""
    mass, r_cg = jnp.asarray(body.mass), jnp.asarray(body.r_cg_from_q)
    return jnp.concatenate([mass[None], mass * r_cg, parallel_axis(jnp.asarray(body.inertia), mass, r_cg)])


def covariance_about_cg(fisher_information: Float[Array, "10 10"], body: Body) -> Float[Array, "10 10"]:
    """Return the covariance of (m, r_cg, tensor about the centre of gravity) that an information leaves.

    Args:
        fisher_information: information of (m, m r, tensor about Q).
        body: at which the parameters' transformation is linearised.
    """
    slope = jax.jacfwd(about_cg)(about_q(body))
    return slope @ jnp.linalg.solve(fisher_information, slope.T)
