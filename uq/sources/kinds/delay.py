"""Delay of the gyro: its samples are of an earlier instant than their stamps say."""

from uq.sources.source import ErrorKind


class Delay(ErrorKind):
    """The sample with the stamp t is ω(t - θ), beside the load cell's of t.

    The law has it by the sums' first and second derivatives; a trial on sums interpolates exact sums at seven delays
    (:class:`uq.monte_carlo.trials.sums_setup.TrueRun`); a trial by samples has the trajectory at other instants.
    """

    name = "delay"
    targets = {"omega": "s"}
    absence = "load cell and gyro have one clock"
    shape = ()
    in_sums_as = "a polynomial in the delay"
    perturbs = {"omega": "gyro_delay"}
