"""What earlier scans tell of the displacement of a body along its axis."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Float32, Float64, UInt8

_STATES, _LINE = array_of(np.uint8, 2), array_of(np.float32)


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
