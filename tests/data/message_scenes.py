"""Results of two frames, with numbers to check by hand."""

from dataclasses import replace

import numpy as np

from perception.geometry import se3
from perception.types import (
    Boxes3D,
    Calibration,
    Detections,
    Frame,
    FusedDetections,
    Obstacles,
    Result,
    Tracks,
    Vehicles,
    Voxels,
)

SIZE_PX = (64, 32)
# As KITTI's: the projection is of the reference camera, 6 cm beside the colour camera.
CALIBRATION = Calibration(
    image_P_cam=np.array([[50.0, 0, 32, 3.0], [0, 50, 16, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
    image_size_px=SIZE_PX,
)
POINTS = np.array(
    [[10, 2, -1, 0.25], [5, 0, -1.7, 0.5], [9, 2.5, -1, 0.75], [0, 0, 0, 0]], np.float32
)
STATES = np.array([3, 1, 3, 0], np.uint8)
TRACKS = Tracks(
    ids=np.array([4, 9]),
    boxes=Boxes3D(
        np.array([[10.0, 2.0, -1.7], [-8.0, -1.0, -1.6]]),
        np.array([[4.2, 1.8, 1.5], [0.8, 0.6, 1.75]]),
        np.array([0.5, 3.0]),
    ),
    velocities_m_s=np.array([[3.0, 4.0], [0.0, -1.0]]),
    is_observed=np.array([True, False]),
    covariances=np.stack([np.diag([0.04, 0.01, 0.25, 0.16]), np.full((4, 4), np.nan)]),
    types=np.array(["Van", ""]),
    scores=np.array([0.8125, np.nan]),
)
# A tracked car on the ground, and one of which there is nothing but a faint box in the image.
VEHICLES = Vehicles(
    fused=FusedDetections(
        Detections(
            np.array([[10.0, 5, 30.5, 20], [40, 8, 50, 12]]),
            np.array([0.875, 0.03125]),
            np.array(["Car", "Van"]),
        ),
        source_indices=np.array([[0, 0, -1], [-1, 1, -1]]),
        dominant_modality=np.array([0, 1]),
        existence=np.array([0.875, 0.03125]),
    ),
    ids=np.array([4, -1]),
    boxes=Boxes3D(
        np.array([[10.0, 2.0, -1.7], [np.nan] * 3]),
        np.array([[4.2, 1.8, 1.5], [np.nan] * 3]),
        np.array([0.0, np.nan]),
    ),
    distances_m=np.array([8.5, np.nan]),
    velocities_m_s=np.array([[3.0, 4.0], [np.nan, np.nan]]),
    covariances=TRACKS.covariances,
    owners=np.array([0, -1, 0, -1]),
)
_EMPTY = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)


def result_at(index: int, *, has_camera: bool = True) -> Result:
    """Return the result of a frame, ten a second: the vehicle heads along the world's y at 10 m/s."""
    image = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
    image[:, :32] = (255, 0, 0)
    frame = Frame(
        index,
        1_700_000_000.5 + 0.1 * index,
        POINTS,
        image=image if has_camera else None,
        calibration=CALIBRATION if has_camera else None,
    )
    pose = se3.from_euler(0, 0, np.pi / 2, np.array([100.0, 50.0 + index, 3.0]))
    boxes_px = np.array([[10.0, 5, 30, 20]])
    result = Result(
        frame,
        pose,
        None,
        Obstacles(STATES, _EMPTY, _EMPTY),
        TRACKS,
        timings_s={"registration": 0.004, "ground": 0.0025},
    )
    if not has_camera:
        return result
    return replace(
        result,
        vehicles=VEHICLES,
        modality_detections={"rgb": Detections(boxes_px, np.array([0.75]), np.array(["Car"]))},
        map_images={"dm": np.full((32, 64), 128, np.uint8)},
    )
