"""Misalignment of a sensor: its axes are the body's, turned by a rotation vector."""

from uq.sources.source import ErrorKind


class Misalignment(ErrorKind):
    """The sensor reads ``exp(θ)ᵀ w`` of a vector w, θ the rotation vector in B from the body's axes to the sensor's."""

    name = "misalignment"
    targets = {"wrench": "rad", "omega": "rad"}
    absence = "the axes of {} are the body's"
    perturbs = {"wrench": "cell_misalignment", "omega": "gyro_misalignment"}
