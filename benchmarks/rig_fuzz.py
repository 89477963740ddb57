"""Coverage-guided fuzzing of the parsers, with atheris (install it for this: ``uv pip install atheris``).

``python -m benchmarks.rig_fuzz KIND [SECONDS]``: random bytes in random pieces; the parser must never raise, must give
the same samples as for the whole, and must account for every byte.
"""

import sys

import atheris

with atheris.instrument_imports(include=["rig"]):
    from rig.devices import create_device, device_class

COLUMNS = ["time us", "omega_x deg/s", "omega_y deg/s", "omega_z deg/s"]


def parser(kind: str):
    """A fresh parser of this kind."""
    return create_device(kind, **({"columns": COLUMNS, "separator": ","} if kind == "line" else {})).parser()


def check(kind: str, data: bytes) -> None:
    """One stream, whole and in pieces."""
    whole, pieces = parser(kind), parser(kind)
    size = 1 + (data[0] if data else 0) % 64
    if device_class(kind).NETWORK == "udp":  # no stream: what is fed is one datagram
        size = max(1, len(data))
    one = whole.feed(data) + whole.finish()
    parts = [sample for i in range(0, len(data), size) for sample in pieces.feed(data[i : i + size])]
    parts += pieces.finish()
    assert repr(one) == repr(parts)  # a NaN does not equal itself
    for p in (whole, pieces):
        assert p.counts.bytes == p.counts.framed + p.counts.skipped == len(data)


def main() -> None:
    """Fuzz one kind."""
    kind, seconds = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "600"
    atheris.Setup(
        [sys.argv[0], f"-max_total_time={seconds}", "-max_len=600", "-print_final_stats=1"], lambda d: check(kind, d)
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
