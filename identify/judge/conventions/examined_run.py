"""A run under examination: its sums, corrected for each finding in turn, and what several findings ask of it.

Which sensor is turned against the other, and where the centre of gravity is, only what the experiment declares tells.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.display.rounding import fixed, significant
from identify.judge.conventions.axis_hypotheses import DECISIVE, Hypothesis
from identify.judge.conventions.convention_fit import ConventionSums, DeclaredRig, Matrix, Vector
from identify.judge.conventions.free_rotation import CERTAIN_SHIFT, tensor_about_centre
from identify.judge.conventions.wrench_units import DRAWN
from identify.judge.cure import Cure, Entries, Opposite
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE

Packed = Float[np.ndarray, "6"]
ON_SENSOR = Entries({"wrench": Opposite("on_sensor", "on_body")})
"""Key that reverses force and moment."""
LEAST_GRAVITY = 2.0
"""Specific force without which nothing is judged [m/s²].

Choice: a fifth of gravity: there is no accelerometer, or its unit is g.
"""
LEAST_SHIFT = 3e-3
"""Distance below which no other point is named [m].

Choice: a drawing's centre of gravity is no better. In 40 clean runs at most 0.5 mm (``tests.helpers.judge_margins``).
"""
TOLD = 0.25
"""Part of an axis in directions that the run does not determine, below which its coordinate is stated.

Choice: the axis lies within 30° of what is determined.
"""


class ExaminedRun:
    """A run, or static poses, under examination: each finding corrects the sums before the next looks at them.

    Args:
        sums: of the run.
        declared: of body and rig.
        wrench: topic of force and moment.
        imu: topic of the motion.
        upward: mean of the accelerometer's reading along the upward axis of a recorded attitude [m/s²]; 0: unknown.
        at_rest: whether it is of static poses, whose force alone tells axes and signs.
    """

    def __init__(
        self, sums: ConventionSums, declared: DeclaredRig, wrench: str, imu: str, *, upward: float = 0.0,
        at_rest: bool = False,
    ) -> None:  # fmt: skip
        self.sums, self.declared, self.wrench, self.imu = sums, declared, wrench, imu
        self.recorded, self.at_rest = sums, at_rest
        self.upward = upward if abs(upward) > LEAST_GRAVITY else 0.0
        self.units_instead: list[Entries] = []
        """Units that explain the moment, of which another point is likelier."""

    # Where the centre of gravity is

    def shift(
        self, sums: ConventionSums | None = None, *, mirrored: bool = False, drawn: float = 1e-3
    ) -> tuple[Vector, float]:
        """Return the shift from the centre of gravity that some sums show to the declared one [m], its chi-square.

        Args:
            sums: None: those of the run.
            mirrored: from the centre on the other side of the moment's point.
            drawn: standard deviation of the declared one, beside the stated [m].
        """
        if self.declared.r_cg is None:
            return np.zeros(3), 0.0
        centre = (self.sums if sums is None else sums).centre
        r = 2 * self.declared.wrench_point - centre.r if mirrored else centre.r
        shift = self.declared.r_cg - r
        shift = shift - centre.undetermined @ shift
        covariance = centre.covariance + np.diag(self.declared.sigma_r_cg**2) + drawn**2 * np.eye(3)
        return shift, float(shift @ np.linalg.solve(covariance, shift))

    def place(self, *, mirrored: bool) -> str:
        """Return the centre of gravity in words, or that on the other side of the moment's point."""
        centre = self.sums.centre
        r = 2 * self.declared.wrench_point - centre.r if mirrored else centre.r
        sure = np.diag(centre.undetermined) < TOLD
        at = ", ".join(fixed(1e3 * x, 1) if known else "?" for x, known in zip(r, sure, strict=True))
        return f"centre of gravity at ({at}) mm"

    def elsewhere(self) -> tuple[float, list[float | None]] | None:
        """Return distance and coordinates of the point that the moment is about [m]; None: it is Q.

        By the declared centre of gravity; a coordinate that the run does not determine is None.
        """
        if self.declared.r_cg is None:
            return None
        shift, certainty = self.shift()
        certain = np.diag(self.sums.centre.undetermined) < TOLD
        distance = float(np.linalg.norm(shift[certain]))
        if certainty < CERTAIN_SHIFT or distance < LEAST_SHIFT:
            return None
        point = shift + self.declared.wrench_point
        return distance, [float(x) if sure else None for x, sure in zip(point, certain, strict=True)]

    # Which sensor is turned

    def turned_back(self, before: ConventionSums, matrix: Matrix) -> tuple[str, Cure]:
        """Turn back the sensor that is turned, as far as known; return its topic, and what does it.

        Args:
            before: sums of the run with the rotation.
            matrix: rotation that undoes it on the wrench.
        """
        turned = _either_turned(before, matrix)
        likelier, certain = self._turned_sensor(turned)
        self.sums = turned[likelier]
        if certain or self.at_rest:
            return (self.wrench if likelier == "wrench" else self.imu), self.rotation_cure(before, matrix)
        as_imu, as_wrench = (tensor_about_centre(turned[sensor], self.declared.r_cg) for sensor in ("imu", "wrench"))
        return self.imu, _either_with_effect(self._entries(matrix), as_imu, as_wrench)

    def rotation_cure(self, before: ConventionSums, matrix: Matrix) -> Cure:
        """Return what undoes a rotation: of one sensor, or of either where nothing tells which is turned."""
        sensor, certain = self._turned_sensor(_either_turned(before, matrix))
        entries = self._entries(matrix)
        if certain:
            return Cure(choices=[Entries(entries[sensor])])
        imu = Entries(entries["imu"], remark=" if the IMU is the rotated one")
        return Cure(choices=[imu, Entries(entries["wrench"], conjunction="otherwise")])

    def wrench_cure(self, matrix: Matrix) -> Entries | Cure:
        """Return what undoes a matrix, proper or not, on the axes of the wrench."""
        if np.array_equal(matrix, -np.eye(3)):
            return ON_SENSOR
        if np.linalg.det(matrix) > 0:
            return self.rotation_cure(self.recorded, matrix)
        return Cure(choices=self.rotation_cure(self.recorded, -matrix).choices, with_it=[ON_SENSOR])

    def rivals(self, fits: Sequence[Hypothesis]) -> list[Entries | Cure]:
        """Return what declares other axes of the wrench that fit as well, at most three."""
        return [self.wrench_cure(fit.matrix) for fit in fits if fit.sensor == "wrench"][:3]

    def _entries(self, matrix: Matrix) -> dict[str, dict[str, object]]:
        """The key that undoes a rotation, by the sensor that is turned."""
        return {
            "imu": {"imu_rotation_to_body": matrix.T @ self.declared.imu_rotation},
            "wrench": {"wrench_rotation_to_body": matrix @ self.declared.wrench_rotation},
        }

    def _turned_sensor(self, turned: dict[str, ConventionSums]) -> tuple[str, bool]:
        """The sensor that is likelier turned, and whether the declared centre of gravity decides."""
        misfits = {sensor: self.shift(sums, drawn=DRAWN)[1] for sensor, sums in turned.items()}
        likelier, other = sorted(misfits, key=misfits.__getitem__)
        return likelier, misfits[other] - misfits[likelier] > DECISIVE / 2


def _either_turned(before: ConventionSums, matrix: Matrix) -> dict[str, ConventionSums]:
    """The sums with a rotation of the wrench's axes undone, by the sensor that is turned."""
    return {"imu": before.turned(imu=matrix.T), "wrench": before.turned(wrench=matrix)}


def _either_with_effect(entries: dict[str, dict[str, object]], as_imu: Packed, as_wrench: Packed) -> Cure:
    """Either rotation undone, with what each does to the tensor.

    Args:
        entries: keys by the sensor that is turned.
        as_imu: packed tensor if it is the IMU [kg·m²].
        as_wrench: packed tensor if it is the load cell [kg·m²].
    """
    k = int(np.argmax(np.abs(as_imu - as_wrench)))
    first, second = (f"{significant(GRAM_METRE * tensor[k], 3)} g·m²" for tensor in (as_imu, as_wrench))
    imu = Entries(entries["imu"], remark=f" if the IMU is the rotated sensor ({COMPONENTS[k]} is then about {first})")
    wrench = Entries(entries["wrench"], remark=f" if the load cell is ({COMPONENTS[k]} is then about {second})")
    return Cure(choices=[imu, wrench], lead="one of two lines that fit the run equally: ")
