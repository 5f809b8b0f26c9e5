"""Normal numbers at the price of a copy: drawn once, and read from a random place on."""

from functools import cache

import numpy as np

from perception.types import Float32

_LENGTH = 1 << 20


def normal_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32:
    """Return standard normal numbers of a shape, which are the same for the same state of `rng`.

    To draw as many anew takes as long as all other changes of a picture together. Two pictures may share
    some of them, at other places.
    """
    count = int(np.prod(shape))
    numbers = _numbers(-(-count // _LENGTH) * _LENGTH)
    first = int(rng.integers(_LENGTH))
    return numbers[first : first + count].reshape(shape)


@cache
def _numbers(length: int) -> Float32:
    numbers = np.random.default_rng(0).standard_normal(length + _LENGTH, np.float32)
    numbers.flags.writeable = False
    return numbers
