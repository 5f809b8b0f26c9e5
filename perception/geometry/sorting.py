"""Sorting of integers with their indices."""

import numpy as np

from perception.types import Int

_BITS = 63  # of a signed number without its sign


def sorted_keys(keys: Int) -> tuple[Int, Int]:
    """Return (N,) keys in rising order, and the index of each; equal keys keep their order.

    Integers sort several times faster than their indices, so the index becomes the last bits of the key. Where
    the range of keys is too large for that, the indices are sorted.
    """
    if len(keys) == 0:
        return keys, np.zeros(0, np.int64)
    lowest, bits = int(keys.min()), len(keys).bit_length()
    if (int(keys.max()) - lowest).bit_length() + bits > _BITS:
        order = np.argsort(keys, kind="stable")
        return keys[order], order
    packed = np.sort(((keys.astype(np.int64) - lowest) << bits) | np.arange(len(keys)))
    return (packed >> bits) + lowest, packed & ((1 << bits) - 1)
