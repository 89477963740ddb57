"""Delay of the gyro: its samples are of an earlier instant than their stamps say."""

from uq.sources.source import ErrorKind


class Delay(ErrorKind):
    """The sample with the stamp t is ω(t - θ), beside the load cell's of t.

    The law has it by the sums' first and second derivatives; a trial evaluates the trajectory at other instants.
    """

    name = "delay"
    targets = {"omega": "s"}
    shape = ()
    constant = True
    needs_samples = True
    perturbs = {"omega": "gyro_delay"}
