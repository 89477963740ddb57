"""How often the weak sums let a wrong frame through, beside theory. ``python -m benchmarks.rig_weak_sums [MEGABYTES]``.

Random bytes: the chance that a frame seems to start at a byte. Two flipped bits: the share of frames whose damage the
sum does not see. Theory for both stands beside the measurement, with its standard error.
"""

import itertools
import math
import sys

import numpy as np

from rig.devices import create_device, microstrain, robotous, xsens
from rig.devices.checksums import fletcher


def in_garbage(kind: str, megabytes: float) -> tuple[int, int]:
    """(frames accepted, bytes) in so much random garbage."""
    draw, parser = np.random.default_rng(11), create_device(kind).parser()
    total = int(megabytes * 1e6)
    for start in range(0, total, 65536):
        parser.feed(draw.bytes(min(65536, total - start)))
    parser.finish()
    return parser.counts.frames, total


# Delimiters, known ids and the sum, each as the chance that random bytes satisfy it.
THEORY = {
    "bota": 2**-8 * 2**-16,
    "robotous": 2**-8 * 2**-8 * 2**-8 * len(robotous.KNOWN) / 256,
    "xsens": 2**-16 * len(xsens.KNOWN) / 256 * 2**-8,  # before the check of the payload's structure, so an upper bound
    "microstrain": 2**-16 * 2**-16,  # the same
    "vectornav": 2**-32 * 2**-16,
}


def garbage(megabytes: float) -> None:
    """Print the rates in random garbage."""
    for kind, chance in THEORY.items():
        wrong, total = in_garbage(kind, megabytes)
        expected = chance * total
        print(
            f"garbage, {kind}: {wrong} frames in {total:.2g} bytes; theory at most {expected:.2f} ± {expected**0.5:.2f}"
        )


def undetected(frame: bytes, parser_of, count: int) -> int:
    """How many of ``count`` random double flips in one frame still make a frame of the same length."""
    draw, found = np.random.default_rng(12), 0
    for _ in range(count):
        number = int.from_bytes(frame, "big")
        for bit in draw.choice(8 * len(frame), 2, replace=False).tolist():
            number ^= 1 << bit
        damaged = number.to_bytes(len(frame), "big")
        parser = parser_of()
        parser.feed(damaged)
        parser.finish()
        found += parser.counts.framed == len(frame)
    return found


def exact_share(frame: bytes, seen) -> float:
    """The share of all pairs of bits whose flip the bare sum does not see: theory, by counting every pair."""
    bits = range(8 * len(frame))
    total = missed = 0
    for a, b in itertools.combinations(bits, 2):
        number = int.from_bytes(frame, "big") ^ 1 << a ^ 1 << b
        total += 1
        missed += seen(number.to_bytes(len(frame), "big"))
    return missed / total


def double_flips(count: int) -> None:
    """Print the shares of undetected double flips."""
    values = (1.25, -2.5, 9.8, 0.125, -0.5, 0.03)
    cases = {
        "robotous": (robotous.encode(values), lambda f: sum(f[1:17]) & 255 == f[17]),
        "xsens": (xsens.encode(7, 70, values[:3], values[3:]), lambda f: not sum(f[1:]) & 255),
        "microstrain": (
            microstrain.encode(10**9, values[:3], values[3:]),
            lambda f: f[-2:] == fletcher(f[:-2]),
        ),
        "bota": (create_device("bota").emulator(rate=800.0).frame(1, 1.0, values), lambda f: False),
    }
    for kind, (frame, seen) in cases.items():
        share = exact_share(frame, seen)
        wrong = undetected(frame, lambda kind=kind: create_device(kind).parser(), count)
        error = math.sqrt(max(share * (1 - share), 1 / count) / count)
        print(f"two flipped bits, {kind}: {wrong / count:.5f} of frames; theory at most {share:.5f} ± {error:.5f}")


def main() -> None:
    """Measure and print."""
    garbage(float(sys.argv[1]) if len(sys.argv) > 1 else 500.0)
    double_flips(100_000)


if __name__ == "__main__":
    main()
