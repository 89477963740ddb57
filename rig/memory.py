"""What a process that records for days does about its memory."""

import contextlib
import ctypes

M_ARENA_MAX = -8  # glibc's malloc.h


def share_one_arena() -> None:
    """Let all threads that start from now on allocate from one heap; does nothing where the C library is not glibc.

    glibc gives each thread a heap of its own. What a reader thread queues and the writer frees then piles up in the
    reader's, fragment by fragment (mallopt(3), ``M_ARENA_MAX``).
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).mallopt(M_ARENA_MAX, 1)
