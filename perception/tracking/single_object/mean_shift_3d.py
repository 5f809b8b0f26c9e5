"""Find an object in a scan by climbing to where points are densest (5.3.2)."""

from dataclasses import dataclass

import numpy as np

from perception.tracking.single_object.window import Window
from perception.types import Float64


@dataclass(frozen=True)
class MeanShiftConfig:
    """When a climb ends.

    Attributes:
        iterations: at most as many shifts.
        tolerance_m: a smaller shift is the last.
    """

    iterations: int = 5  # η, Table 7.5
    tolerance_m: float = 0.05  # δl, Table 7.5


def mean_shift_3d(
    points_m: Float64, window: Window, config: MeanShiftConfig, weights: Float64 | None = None
) -> Window | None:
    """Shift a window to the mean of the points within, until it moves less than a few centimetres.

    (5.11) and (5.12) with the sign that leads to the mean; as printed they lead away from it.

    Args:
        points_m: (N, 3) of obstacles.
        window: where the object is expected.
        config: when to stop.
        weights: (N,) how much each point counts; all the same where None.

    Returns:
        the window at its end, or None where it held nothing in the beginning.
    """
    mass = np.ones(len(points_m)) if weights is None else weights
    is_found = False
    for _ in range(config.iterations):
        inside = window.contains(points_m)
        total = mass[inside].sum()
        if not total > 0:
            break
        mean_m = mass[inside] @ points_m[inside] / total
        shift_m = float(np.linalg.norm(mean_m - window.position_m))
        window, is_found = window.moved(mean_m), True
        if shift_m < config.tolerance_m:
            break
    return window if is_found else None
