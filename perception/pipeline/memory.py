"""Memory that threads share: few heaps, so that one thread uses what another has freed."""

import ctypes
import sys

# Number of the setting in glibc's malloc.h.
_M_ARENA_MAX = -8
_HEAPS = 2


def limit_heaps() -> None:
    """Limit the heaps of the C library, which by default makes one for each thread; other libraries have no such limit.

    Measured with all stages on sequence 0000: 299 MiB instead of 366, and a third fewer page faults.
    """
    if sys.platform == "linux":
        limit = getattr(ctypes.CDLL(None), "mallopt", None)
        if limit is not None:
            limit(_M_ARENA_MAX, _HEAPS)
