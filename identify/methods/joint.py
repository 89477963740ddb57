"""The joint estimate: tensor, mass, r_CG, offsets, delay and rotation together, most probable given what is known."""

from identify.exceptions import RunError
from identify.floating_point import check_precision
from identify.joint.alignment_prior import Alignment
from identify.joint.joint_estimator import joint, specific_force_of, static_knowledge
from identify.methods.base import Estimator, Problem
from identify.results.identification_result import Identification


class JointEstimator(Estimator):
    """All unknowns of all channels together; see :mod:`identify.joint.joint_estimator`."""

    type_a = (
        "Tensor, mass, centre of gravity, offsets, delay and rotation were estimated together from the residuals' "
        "noise and from what was declared of them beforehand; where the runs scatter more, that counts."
    )
    estimates = frozenset(
        {"mass", "cell_bias", "cell_misalignment", "gyro_bias", "gyro_misalignment", "gyro_delay"},
    )

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty.

        Raises:
            RunError: no float64, or offsets that are taken from rest.
        """
        if check_precision("float64"):
            raise RunError("the joint estimate needs float64: run jax.config.update('jax_enable_x64', True) first")
        if problem.offsets == "still":
            raise RunError(
                'the joint estimate finds offsets itself: write offsets = "estimate", or use the method source'
            )
        runs, band = list(problem.runs), None if problem.estimator is None else problem.estimator.band
        blocks = static_knowledge(
            runs, r_cg=problem.r_cg, sigma_r_cg=problem.sigma_r_cg, mass=problem.mass,
            mass_uncertainty=problem.mass_uncertainty, gravity=problem.gravity, offsets=problem.offsets,
            centre=problem.centre,
        )  # fmt: skip
        return joint(
            runs, band=problem.band() if band is None else band, blocks=blocks,
            alignment=problem.alignment or Alignment(), specific_force=specific_force_of(runs, problem.cg_motion),
            gravity=problem.gravity, offsets=problem.offsets,
        )  # fmt: skip
