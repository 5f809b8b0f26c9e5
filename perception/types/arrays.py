"""Array types by the type of their numbers, and the validation of shapes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.errors import PerceptionError

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Complex64 = NDArray[np.complex64]
Float = NDArray[np.float32] | NDArray[np.float64]
Int = NDArray[np.int32] | NDArray[np.int64]
UInt8 = NDArray[np.uint8]
Bool = NDArray[np.bool_]


def require_shape(what: str, array: NDArray[Any], expected: tuple[int | str, ...]) -> None:
    """Validate the shape of an array; a letter, such as N, stands for any length."""
    fits = array.ndim == len(expected)
    for have, want in zip(array.shape, expected, strict=False):
        fits &= have == want or isinstance(want, str)
    if not fits:
        shape = "(" + ", ".join(map(str, expected)) + ")"
        raise PerceptionError(what, expected=f"shape {shape}", found=f"shape {array.shape}")
