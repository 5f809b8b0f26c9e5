"""Points of a sweep, each moved by the pose at its own time."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Float32, Float64


@compiled((array_of(np.float32, 2), array_of(np.float32), array_of(np.float64, 3), NUMBER, NUMBER))
def move_by_time(
    points: Float32, times_s: Float32, poses: Float64, first_s: float, step_s: float
) -> Float32:
    """Return (N, C) points, x, y, z moved by the poses before and after each time, blended; others stay.

    Points without a return, x = y = z = 0, stay as they are.

    Args:
        points: (N, C) points, C at least 3.
        times_s: (N,) time of each point; beyond the first and the last pose these are taken.
        poses: (K, 4, 4) transforms at even times, K at least 2.
        first_s: Time of the first pose.
        step_s: Time between two poses.
    """
    moved = points.copy()
    last = len(poses) - 1
    for row in range(len(points)):
        x, y, z = np.float64(points[row, 0]), np.float64(points[row, 1]), np.float64(points[row, 2])
        if x == 0.0 and y == 0.0 and z == 0.0:
            continue
        place = (np.float64(times_s[row]) - first_s) / step_s
        # The comparison is false with NaN, which takes the first pose.
        place = min(place, np.float64(last)) if place > 0.0 else np.float64(0.0)
        before = min(int(place), last - 1)
        share = place - before
        for axis in range(3):
            here, there = poses[before, axis], poses[before + 1, axis]
            start = here[0] * x + here[1] * y + here[2] * z + here[3]
            end = there[0] * x + there[1] * y + there[2] * z + there[3]
            moved[row, axis] = np.float32(start + share * (end - start))
    return moved
