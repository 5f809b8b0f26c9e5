"""A drive of few points, for what is written in many layouts."""

import numpy as np

from data.synthetic.lidar import LidarScan
from data.synthetic.rig import default_calibration
from perception.geometry.se3 import from_rotation_translation
from perception.sensor import VLP_16
from perception.types import Boxes3D, Labels, PointTruth

_GRID_M = 2.0**-10  # coordinates that survive a shift by the place of the LiDAR


class TinyDrive:
    """Two frames of a flat road and one car ahead that drives away, of few points."""

    sensor = VLP_16
    calibration = default_calibration().camera

    def __len__(self) -> int:
        return 2

    def stamp_s(self, index: int) -> float:
        return 0.1 * index

    def world_SE3_velo(self, index: int) -> np.ndarray:
        return from_rotation_translation(np.eye(3), np.array([0.5 * index, 0.0, 1.75]))

    def scan(self, index: int) -> LidarScan:
        radius_m, azimuth = np.meshgrid(np.geomspace(4, 40, 16), np.linspace(-np.pi, np.pi, 60))
        road = [
            radius_m * np.cos(azimuth),
            radius_m * np.sin(azimuth),
            np.full_like(azimuth, -1.75),
        ]
        y, z = np.meshgrid(np.linspace(-0.75, 0.75, 7), np.linspace(-1.25, -0.5, 5))
        car = [np.full_like(y, 10.25 + 0.5 * index), y, z]
        points = np.stack(
            [np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(road, car, strict=True)], 1
        )
        points = np.round(points / _GRID_M) * _GRID_M
        count, of_car = len(points), np.arange(len(points)) >= radius_m.size
        truth = PointTruth(np.where(of_car, 10, 40), np.where(of_car, 8, 0), of_car)
        reflectance = np.full((count, 1), 51 / 255)
        return LidarScan(np.hstack([points, reflectance]).astype(np.float32), truth)

    def point_truth(self, index: int) -> PointTruth:
        return self.scan(index).truth

    def labels_around(self, index: int) -> Labels:
        bottom_m = np.array([[12.0 + 0.5 * index, 0.0, -1.5]])
        return Labels(
            boxes_velo=Boxes3D(bottom_m, np.array([[4.0, 1.75, 1.5]]), np.zeros(1)),
            boxes_px=np.full((1, 4), -1.0),
            types=np.array(["Car"]),
            track_ids=np.array([7]),
            truncation=np.zeros(1),
            occlusion=np.zeros(1, np.int64),
            dont_care_px=np.zeros((0, 4)),
        )
