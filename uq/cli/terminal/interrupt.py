"""Ctrl-C: one handler from the command's first step to its last, whose exception cannot be swallowed.

Python raises KeyboardInterrupt wherever the program is. There a library may catch it: JAX has ``except:`` in a dozen
places, and what is raised in the callback of a weak reference goes nowhere. The command would go on as if nothing had
happened. So a thread looks whether the exception is still alive; if nobody holds it any more, the command is
interrupted again.
"""

import _thread
import contextlib
import os
import signal
import sys
import time
import weakref
from collections.abc import Iterator
from typing import NoReturn

STATUS = 130
"""Exit status of an interrupted command: 128 and the number of SIGINT."""
LOOK = 0.05
"""Seconds between two looks whether the exception is still on its way."""


class Interrupted(KeyboardInterrupt):
    """Raised by Ctrl-C. It lives as long as it is on its way, through every ``finally``, too."""


class Interrupt:
    """Treatment of Ctrl-C by a command: in its imports it ends at once, then the exception is raised, then nothing."""

    def __init__(self) -> None:
        """Begin with the imports; nothing is heard before :meth:`listen`."""
        self.at_once, self.over = True, False
        self.raised: list[weakref.ref[Interrupted]] = []

    def listen(self) -> None:
        """Answer Ctrl-C from now on, but not where SIGINT is ignored from the start, as behind ``&`` in a script."""
        if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
            signal.signal(signal.SIGINT, self._answer)
            sys.unraisablehook = _silent_of_interrupts

    @contextlib.contextmanager
    def raising(self) -> Iterator[None]:
        """Let Ctrl-C raise, so that the work within tidies up; Python's own end then does not meet another one.

        Raises:
            KeyboardInterrupt: Ctrl-C came, whatever a library has made of it.
        """
        try:
            self.at_once = False
            yield
        except Exception as error:
            if not self.raised:
                raise
            raise KeyboardInterrupt from error
        finally:
            self.over = True
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    def _answer(self, *_: object) -> None:
        if self.over:
            return
        if self.at_once:
            with contextlib.suppress(OSError):  # nobody hears it
                os.write(sys.stderr.fileno(), b"error: interrupted\n")
            os._exit(STATUS)  # interrupted imports would have much to say of it
        error = Interrupted()
        if not self.raised:
            with contextlib.suppress(RuntimeError):  # no memory for a thread
                # Not by `threading`, whose lock the interrupted step may hold.
                _thread.start_new_thread(self._watch, ())
        self.raised.append(weakref.ref(error))
        try:
            raise error
        finally:
            del error  # else this frame, which the traceback keeps, would keep it alive

    def _watch(self) -> None:
        """Interrupt again whenever the exception got lost."""
        while not self.over:
            time.sleep(LOOK)
            if all(error() is None for error in self.raised):
                _thread.interrupt_main()


def leave() -> NoReturn:
    """End an interrupted process here: JAX may be at work in threads, for which Python's end would wait, or crash."""
    with contextlib.suppress(OSError):  # nobody reads on
        sys.stdout.flush()
    os._exit(STATUS)


def _silent_of_interrupts(lost: "sys.UnraisableHookArgs") -> None:
    """Say nothing of an interrupt that was raised where nothing can be; it is raised again."""
    if not issubclass(lost.exc_type, Interrupted):
        sys.__unraisablehook__(lost)
