"""A scene small enough to check by hand: flat ground, one static and one moving voxel."""

from dataclasses import dataclass

import numpy as np
import pytest

from perception.types import Calibration, Frame, Obstacles, Result, Voxels

GROUND_Z = -1.73


@dataclass(frozen=True)
class FlatGround:
    def height_m(self, xy_m):
        return np.full(len(xy_m), GROUND_Z)

    def distance_m(self, points_velo):
        return points_velo[:, 2] - GROUND_Z


def voxels_at(*centers_m, size_m=0.1):
    centers = np.array(centers_m, np.float32).reshape(-1, 3)
    return Voxels(centers, np.full(len(centers), 9), size_m)


# Looks along +x from the LiDAR's origin; a pixel is 1 cm at 1 m.
FORWARD_CAMERA = Calibration(
    image_P_cam=np.array([[100.0, 0, 100, 0], [0, 100.0, 50, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    image_size_px=(200, 100),
)


@pytest.fixture
def scene():
    points = np.array(
        [[8, 2, -1.7, 0.3], [10, -1, 0, 0.5], [12, 1, 0, 0.5], [43, 3, 2, 0.9]], np.float32
    )
    frame = Frame(
        index=7,
        stamp_s=0.7,
        points_velo=points,
        image=np.full((100, 200, 3), 128, np.uint8),
        world_SE3_velo=np.eye(4),
        calibration=FORWARD_CAMERA,
    )
    obstacles = Obstacles(
        np.array([1, 2, 3, 0], np.uint8), voxels_at((10, -1, 0)), voxels_at((12, 1, 0))
    )
    timings_s = {"registration": 0.012, "ground": 0.006, "obstacles": 0.010}
    return Result(frame, np.eye(4), FlatGround(), obstacles, timings_s=timings_s)
