"""Delay of the gyro: its samples are of an earlier instant than their stamps say."""

from uq.sources.source import Beside, ErrorKind, Source

LARGEST_REMAINDER = 1e-4
"""Largest remainder of the polynomial in the delay, in parts of the delay's largest effect; beyond it, the trajectory
is evaluated."""


class Delay(ErrorKind):
    """The sample with the stamp t is ω(t - θ), beside the load cell's of t.

    The law has it by the sums' first and second derivatives; a trial as a polynomial in θ
    (:mod:`uq.gram_sums.delayed_omega`), or by the trajectory at other instants.
    """

    name = "delay"
    targets = {"omega": "s"}
    absence = "load cell and gyro have one clock"
    shape = ()
    constant = True
    needs_samples = True
    in_sums_as = "a polynomial in the delay"
    perturbs = {"omega": "gyro_delay"}

    def in_sums(self, source: Source, beside: Beside) -> Source | None:
        """Return the source where the polynomial is good enough."""
        return source if beside.remainder <= LARGEST_REMAINDER else None
