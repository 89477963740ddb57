"""Memory settings of a process that records for days."""

import contextlib
import ctypes

M_ARENA_MAX = -8  # glibc's malloc.h
NOT_GLIBC = (OSError, AttributeError, TypeError)  # the last on Windows, where a library must be named


def share_one_arena() -> None:
    """Let all threads that start from now on allocate from one heap; does nothing where the C library is not glibc.

    glibc gives each thread a heap of its own. What a reader thread queues and the writer frees then piles up in the
    reader's, fragment by fragment (mallopt(3), ``M_ARENA_MAX``).
    """
    with contextlib.suppress(*NOT_GLIBC):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 1)


def give_back() -> None:
    """Return what is free in the heap to the system (malloc_trim(3)); does nothing where the C library is not glibc.

    Chunks of every size come and go between small objects that stay, so the free part of the heap grows for hours
    while what is used does not.
    """
    with contextlib.suppress(*NOT_GLIBC):
        ctypes.CDLL(None).malloc_trim(0)
