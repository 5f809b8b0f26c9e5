"""A result whose numbers can be checked by hand, for what writes results."""

from dataclasses import replace

import numpy as np

from perception.geometry import se3
from perception.types import (
    BoxDeviations,
    Boxes3D,
    Calibration,
    Detections,
    Frame,
    FusedDetections,
    Obstacles,
    Result,
    StageSpan,
    Tracks,
    Vehicles,
    Voxels,
)

# A van ahead that was seen, and a walker behind, who is predicted and whom no detector has classified.
VAN_COVARIANCE = np.diag([0.04, 0.01, 0.25, 0.16])
DEVIATIONS = BoxDeviations(
    np.array([[0.4, 0.1, 0.1], [np.nan] * 3]), np.array([0.05, np.nan]), np.array([0.1, np.nan])
)
TRACKS = Tracks(
    ids=np.array([4, 9]),
    boxes=Boxes3D(
        np.array([[10.0, 2.0, -1.7], [-8.0, -1.0, -1.6]]),
        np.array([[4.2, 1.8, 1.5], [0.8, 0.6, 1.75]]),
        np.array([0.0, 3.0]),
    ),
    velocities_m_s=np.array([[3.0, 4.0], [0.0, -1.0]]),
    is_observed=np.array([True, False]),
    covariances=np.stack([VAN_COVARIANCE, np.full((4, 4), np.nan)]),
    box_deviations=DEVIATIONS,
    types=np.array(["Van", ""]),
    scores=np.array([0.8125, np.nan]),
)
# A tracked car on the ground, and one of which there is nothing but a faint box in the image.
VEHICLES = Vehicles(
    fused=FusedDetections(
        Detections(
            np.array([[500.0, 150, 620.25, 240], [10, 160, 60, 200]]),
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
    box_deviations=DEVIATIONS,
    owners=np.array([0, -1, 0]),
)
MODALITY_DETECTIONS = {
    "rgb": Detections(np.array([[500.0, 150, 620, 240]]), np.array([0.75]), np.array(["Car"])),
    "dm": Detections(
        np.array([[498.0, 150, 622, 240], [10, 160, 60, 200]]),
        np.array([0.5, 0.25]),
        np.array(["Car", "Van"]),
    ),
}
# One point of the ground, one static and one moving, the vehicle's.
POINTS_VELO = np.array([[8, 2, -1.7, 0.25], [10, -1, 0, 0.5], [10, 2, -1, 0.75]], np.float32)
# Focal length 700 pixels; looks along +x from the LiDAR's origin; its image is red in the left half.
CAMERA = Calibration(
    image_P_cam=np.array([[700.0, 0, 320, 0], [0, 700.0, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    image_size_px=(640, 360),
)
IMAGE = np.zeros((360, 640, 3), np.uint8)
IMAGE[:, :320, 0] = 255


def known_result(index: int = 7, *, has_camera: bool = True) -> Result:
    """Return the result of a frame, ten frames a second; without a camera there are scan and tracks."""
    # The vehicle is at (100, 50, 3) and heads along the world's y.
    pose = se3.from_euler(0, 0, np.pi / 2, np.array([100.0, 50.0, 3.0]))
    voxels = [Voxels(POINTS_VELO[[row], :3], np.ones(1, np.int64), 0.1) for row in (1, 2)]
    result = Result(
        Frame(index, 0.1 * index, POINTS_VELO),
        pose,
        None,
        Obstacles(np.array([1, 2, 3], np.uint8), *voxels),
        TRACKS,
        timings_s={"ground": 0.005, "fusion": 0.002},
        spans=(
            StageSpan("ground", "lidar", 0.001, 0.006),
            StageSpan("fusion", "camera", 0.006, 0.008),
        ),
        skipped=("DepthCN",),
    )
    if not has_camera:
        return result
    return replace(
        result,
        frame=replace(result.frame, image=IMAGE, calibration=CAMERA),
        modality_detections=MODALITY_DETECTIONS,
        vehicles=VEHICLES,
        map_images={"dm": np.full((360, 640), 128, np.uint8)},
    )
