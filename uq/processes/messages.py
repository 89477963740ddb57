"""Messages between a command and its processes: a length of eight bytes, and so many bytes."""

from typing import IO

LENGTH = 8
"""Bytes of the length."""


def send(pipe: IO[bytes], message: bytes) -> None:
    """Write a message at once. Raises OSError: nobody reads."""
    pipe.write(len(message).to_bytes(LENGTH, "little"))
    pipe.write(message)
    pipe.flush()


def receive(pipe: IO[bytes]) -> bytes | None:
    """Return the next message; None: there is no whole one any more."""
    length = pipe.read(LENGTH)
    if len(length) < LENGTH:
        return None
    size = int.from_bytes(length, "little")
    message = pipe.read(size)
    return message if len(message) == size else None
