"""The conversation with a device at the start: a generator that asks for bytes to be sent and listened for. No I/O."""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

from rig.exceptions import RigError


class Send(NamedTuple):
    """Ask the port to send these bytes."""

    data: bytes


class Listen(NamedTuple):
    """Ask the port for what arrives within so many seconds; it answers ``(bytes, seconds it took)`` at the first."""

    seconds: float


class Inquire(NamedTuple):
    """Ask another TCP port of the same host; it answers ``(all bytes until that side closes, seconds it took)``.

    No bytes: nobody answers there, or the port is no network's.
    """

    number: int
    data: bytes


@dataclass(frozen=True)
class Identity:
    """The device that answered: model, serial number, firmware, and the settings it reported back.

    ``extra`` are facts that the parser needs (see each device); ``warnings`` go to the user and into the file.
    """

    model: str = ""
    serial: str = ""
    firmware: str = ""
    settings: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


class NoAnswerError(RigError):
    """The device did not answer in time; ``heard`` says whether any bytes came."""

    def __init__(self, message: str, heard: int) -> None:
        super().__init__(message)
        self.heard = heard


def ascii_text(data: bytes) -> str:
    """Return a text of fixed length without what fills it up."""
    return data.decode("ascii", "replace").strip("\0 ")


Heard = tuple[bytes, float]
Conversation = Generator[Send | Listen | Inquire, Heard, Identity]
T = TypeVar("T")


def ask(
    command: bytes, find: Callable[[bytes], T | None], *, seconds: float = 0.5, tries: int = 3
) -> Generator[Send | Listen, Heard, T]:
    """Send a command until ``find`` recognises the answer in the bytes heard since.

    Raises:
        NoAnswerError: no answer in any try.
    """
    heard = b""
    for _ in range(tries):
        yield Send(command)
        remaining = seconds
        while remaining > 0:
            data, took = yield Listen(remaining)
            heard += data
            remaining -= took
            answer = find(heard)
            if answer is not None:
                return answer
    raise NoAnswerError(f"no answer to {command!r}", len(heard))
