"""Sorting of integers with their indices."""

import numpy as np

from perception.kernels.sorting import sorted_by_digits
from perception.types import Int


def sorted_keys(keys: Int) -> tuple[Int, Int]:
    """Return (N,) keys in rising order, and the index of each; equal keys keep their order.

    Several times as fast as sorting the indices, and as NumPy's sort where a processor is slow at its instructions.
    """
    if len(keys) == 0:
        return keys, np.zeros(0, np.int64)
    return sorted_by_digits(np.ascontiguousarray(keys, np.int64))
