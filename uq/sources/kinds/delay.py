"""Delay of the gyro: its samples are of an earlier instant than their stamps say."""

from uq.sources.source import Beside, ErrorKind, Source

LARGEST_REMAINDER = 1e-4
"""Largest error of sums that are interpolated between delays, in parts of the delay's largest effect."""


class Delay(ErrorKind):
    """The sample with the stamp t is ω(t - θ), beside the load cell's of t.

    The law has it by the sums' first and second derivatives; a trial on sums interpolates exact sums at seven delays
    (:class:`uq.trials.sums_setup.TrueRun`); a trial by samples has the trajectory at other instants.
    """

    name = "delay"
    targets = {"omega": "s"}
    absence = "load cell and gyro have one clock"
    shape = ()
    constant = True
    needs_samples = True
    in_sums_as = "a polynomial in the delay"
    perturbs = {"omega": "gyro_delay"}

    def in_sums(self, source: Source, conditions: Beside) -> Source | str:
        """Return the source where the polynomial is good enough."""
        return source if conditions.remainder <= LARGEST_REMAINDER else f"{source.name} is too long for a polynomial"
