"""Sorting of integers with their indices, digit by digit."""

import numpy as np

from perception.kernels.compiled import array_of, compiled
from perception.types import Int

_DIGIT_BITS = 11


@compiled((array_of(np.int64),))
def sorted_by_digits(keys: Int) -> tuple[Int, Int]:
    """Return (N,) keys in rising order, and the index of each; equal keys keep their order.

    A pass sorts by one digit, the last first, and keeps the order of equal digits. Digits that all keys share take none.
    """
    count, size = len(keys), 1 << _DIGIT_BITS
    ordered, order = keys.copy(), np.arange(count)
    next_ordered, next_order = np.empty(count, np.int64), np.empty(count, np.int64)
    lowest, highest = keys[0], keys[0]
    for key in keys:
        lowest, highest = min(lowest, key), max(highest, key)
    # Differences from the lowest key are positive; without a sign they never overflow.
    span = np.uint64(highest - lowest)
    starts = np.empty(size + 1, np.int64)
    for bits in range(0, 64, _DIGIT_BITS):
        shift = np.uint64(bits)
        if (span >> shift) == 0:
            break
        starts[:] = 0
        for k in range(count):
            digit = (np.uint64(ordered[k] - lowest) >> shift) & np.uint64(size - 1)
            starts[np.int64(digit) + 1] += 1
        if starts[1:].max() < count:
            for number in range(size):
                starts[number + 1] += starts[number]
            for k in range(count):
                digit = (np.uint64(ordered[k] - lowest) >> shift) & np.uint64(size - 1)
                at = starts[np.int64(digit)]
                next_ordered[at], next_order[at] = ordered[k], order[k]
                starts[np.int64(digit)] += 1
            ordered, next_ordered = next_ordered, ordered
            order, next_order = next_order, order
    return ordered, order
