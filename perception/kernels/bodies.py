"""The axis of a body, and what earlier scans tell of its displacement along it."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Float32, Float64, UInt8

_STATES, _LINE = array_of(np.uint8, 2), array_of(np.float32)
_STEPS = 60  # headings of a quarter turn
_FAR_INSIDE_M = 0.3  # from the sides, from which on places tell nothing of them


@compiled((array_of(np.float32, 2),))
def longer_axis(places_m: Float32) -> tuple[float, float]:
    """Return the heading of the longer side of an outline of (P, 2) places in rad, and its length.

    Of all rectangles around the outline it is the one whose sides its places are closest to: the smallest rectangle
    around one side and one end of a body may lie along the diagonal.
    """
    best_m, heading_rad, length_m = np.inf, 0.0, 0.0
    turned = np.empty((2, len(places_m)))
    for step in range(_STEPS):
        angle_rad, away_m = step * np.pi / 2 / _STEPS, 0.0
        cos, sin = np.cos(angle_rad), np.sin(angle_rad)
        for k in range(len(places_m)):
            turned[0, k] = cos * places_m[k, 0] + sin * places_m[k, 1]
            turned[1, k] = cos * places_m[k, 1] - sin * places_m[k, 0]
        low_x, high_x = turned[0].min(), turned[0].max()
        low_y, high_y = turned[1].min(), turned[1].max()
        for k in range(len(places_m)):
            x, y = turned[0, k], turned[1, k]
            away_m += min(x - low_x, high_x - x, y - low_y, high_y - y, _FAR_INSIDE_M)
        if away_m < best_m:
            best_m, length_m = away_m, max(high_x - low_x, high_y - low_y)
            heading_rad = angle_rad + (np.pi / 2 if high_y - low_y > high_x - low_x else 0.0)
    return heading_rad, length_m


@compiled((_STATES, _STATES, _LINE, _LINE, NUMBER, NUMBER, NUMBER))
def displacement_evidence(
    then: UInt8,
    now: UInt8,
    along_m: Float32,
    distances_m: Float32,
    low_m: float,
    high_m: float,
    margin_m: float,
) -> Float64:
    """Return how many more samples of a body tell that it came by each of D distances than that it rests.

    Args:
        then: (D, S) visibility of its S samples in an earlier scan, moved back by each distance; the middle one is 0.
        now: (D, S) visibility of these places in the newest scan.
        along_m: (S,) positions of the samples along the axis.
        distances_m: (D,) distances.
        low_m: Where the body ends to the rear; beyond, it covers nothing.
        high_m: Where it ends to the front.
        margin_m: Distance within which a return may be of the body itself.
    """
    gains, rests = np.zeros(len(distances_m)), then[len(then) // 2]
    for row in range(len(distances_m)):
        for s in range(len(along_m)):
            ahead_m, behind_m = along_m[s] + distances_m[row], along_m[s] - distances_m[row]
            # By how far the body of then did not cover this place, and that of now does not cover the place of then.
            before_m = max(ahead_m - high_m, low_m - ahead_m)
            after_m = max(behind_m - high_m, low_m - behind_m)
            gain = int(rests[s] == 1 and before_m > 0) - int(rests[s] == 2 and before_m > margin_m)
            if then[row, s] == 1:
                gain -= 1
            elif then[row, s] == 2:
                gain += int(now[row, s] == 1 and after_m > 0)
                gain -= int(now[row, s] == 2 and after_m > margin_m)
            gains[row] += gain
    return gains
