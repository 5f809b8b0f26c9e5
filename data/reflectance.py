"""Full scale of the reflectance of a drive: sensors and data sets count to 1, to 255 or to 65535."""

from collections.abc import Iterable, Sequence

import numpy as np

from perception.types import Float32

SCALES = (1.0, 255.0, 65535.0)
_SCANS = 5  # of a drive; each has tens of thousands of returns, of which some are bright
_MIN_ABOVE = 1.5  # a whole number above 1, rather than a value of 0..1 that is rounded up


def sample_indices(count: int, samples: int = _SCANS) -> Sequence[int]:
    """Return indices of some of a number of scans, evenly distributed over them."""
    return sorted({round(index) for index in np.linspace(0, count - 1, min(samples, count))})


def largest_reflectance(scans: Iterable[Float32]) -> float:
    """Return the largest finite reflectance of (N, 4) points of the usual one of some scans; 0 without any.

    It is the median over the scans: one damaged point must not change a whole drive.
    """
    columns = (points[:, 3] for points in scans)
    largest = [float(values[np.isfinite(values)].max(initial=0.0)) for values in columns]
    return float(np.median(largest)) if largest else 0.0


def full_scale(largest: float) -> float:
    """Return the full scale that a drive's largest reflectance is of; 1 where it is of none that is known."""
    if largest <= _MIN_ABOVE:
        return 1.0
    return next((scale for scale in SCALES if largest <= scale), 1.0)


def scale_note(source: str, largest: float, scale: float) -> str:
    """Return a sentence that says by what the reflectance of a drive is divided."""
    return (
        f"{source}: reflectance up to {largest:g}, divided by {scale:g}; "
        "another full scale is given by --reflectance-scale"
    )
