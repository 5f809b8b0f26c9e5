"""Run every stage on one scan: KITTI's binary format, or any (N, 4) array of x, y, z in metres and reflectance 0..1.

python docs/examples/one_frame.py scan.bin
"""

import sys

import numpy as np

from perception.pipeline import Pipeline
from perception.types import Frame, PointState, Result


def describe(result: Result) -> list[str]:
    """Return what is known of one scan: its points by state, and the ground 10 m ahead."""
    states = np.bincount(result.obstacles.point_states, minlength=len(PointState))
    lines = [f"{state.name.lower()}: {states[state]} points" for state in PointState]
    below_m = -result.ground.height_m(np.array([[10.0, 0.0]]))[0]
    return [*lines, f"ground 10 m ahead: {below_m:.2f} m below the LiDAR"]


def main(path: str) -> None:
    """Print what is known of the scan of a file."""
    points_velo = np.fromfile(path, np.float32).reshape(-1, 4)
    with Pipeline() as pipeline:
        result = pipeline.step(Frame(index=0, stamp_s=0.0, points_velo=points_velo))
    print("\n".join(describe(result)))


if __name__ == "__main__":
    main(sys.argv[1])
