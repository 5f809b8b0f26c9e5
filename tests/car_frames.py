"""Object frames with cars of points on a flat road, whose labels fit these points."""

from pathlib import Path

import numpy as np

from data.kitti.calibration import DriveCalibration, format_benchmark_calibration
from data.kitti.labels import format_object_labels
from perception.geometry.camera import project
from perception.types import Boxes3D, Calibration, Labels

ROAD_M = -1.7
SIZE_PX = (620, 190)
CALIBRATION = Calibration(
    image_P_cam=np.array([[360.0, 0, 310, 0], [0, 360, 86, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=SIZE_PX,
)


def write_car_frames(
    root: Path, frames: int = 4, *, kind: str = "Car", cars: int = 2, camera: bool = True
) -> Path:
    """Write frames in KITTI's object layout, without images; return their root."""
    training = root / "training"
    for name in ("velodyne", "label_2", *["calib"] * camera):
        (training / name).mkdir(parents=True)
    for number in range(frames):
        rng = np.random.default_rng(number)
        places_m = np.column_stack(
            [12 + 6 * np.arange(cars) + rng.uniform(0, 2, cars), 5.0 - 6 * np.arange(cars)]
        )
        bodies = [_body(place_m) for place_m in places_m]
        scan = np.concatenate([_road(rng), *bodies]).astype(np.float32)
        (training / "velodyne" / f"{number:06d}.bin").write_bytes(scan.tobytes())
        text = format_object_labels(_labels(places_m, bodies, kind), CALIBRATION)
        (training / "label_2" / f"{number:06d}.txt").write_text(text)
        if camera:
            text = format_benchmark_calibration(DriveCalibration(CALIBRATION, None))
            (training / "calib" / f"{number:06d}.txt").write_text(text)
    return root


def write_car_frames_with_a_gap(root: Path) -> Path:
    """Write frames 0, 2 and 3 in KITTI's object layout, without images; return their root."""
    write_car_frames(root, frames=4)
    for file in root.rglob("000001.*"):
        file.unlink()
    return root


def _road(rng: np.random.Generator) -> np.ndarray:
    xy = rng.uniform((5, -12), (40, 12), (4000, 2))
    return np.column_stack([xy, np.full(4000, ROAD_M), np.full(4000, 0.2)])


def _body(place_m: np.ndarray) -> np.ndarray:
    """Return points 0.1 m apart on the rear of a car."""
    y, z = np.meshgrid(np.arange(-0.8, 0.85, 0.1), np.arange(0.1, 1.5, 0.1))
    x = np.full(y.size, place_m[0])
    return np.column_stack([x, place_m[1] + y.ravel(), ROAD_M + z.ravel(), np.full(y.size, 0.5)])


def _labels(places_m: np.ndarray, bodies: list[np.ndarray], kind: str) -> Labels:
    count = len(places_m)
    pixels = [project(CALIBRATION.image_P_velo, body)[0] for body in bodies]
    boxes_px = [[*of_body.min(axis=0), *of_body.max(axis=0)] for of_body in pixels]
    bottom_m = np.column_stack([places_m[:, 0] + 2, places_m[:, 1], np.full(count, ROAD_M)])
    return Labels(
        boxes_velo=Boxes3D(bottom_m, np.tile([4.0, 1.7, 1.5], (count, 1)), np.zeros(count)),
        boxes_px=np.array(boxes_px).reshape(-1, 4),
        types=np.full(count, kind),
        track_ids=np.full(count, -1),
        truncation=np.zeros(count),
        occlusion=np.zeros(count, int),
        dont_care_px=np.zeros((0, 4)),
    )
