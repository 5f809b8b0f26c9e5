"""KITTI's label rows, read and written; their camera conventions end here.

A row holds, after the frame and the track id that only tracking labels have:

    type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  ry  [score]

with x y z the centre of the bottom face in the rectified camera (x right, y down, z forward) and ry
the heading about the camera's y axis, 0 to the right. In the LiDAR frame that is yaw = -ry - pi/2.
"""

from pathlib import Path

import numpy as np

from data.kitti.rows import ObjectRows, read_object_rows
from perception.errors import CalibrationError, DriveError
from perception.geometry.boxes import observation_angles_rad
from perception.geometry.se3 import wrap
from perception.types import Boxes3D, Calibration, Float64, Labels

DONT_CARE = "DontCare"


def read_tracking_labels(path: Path, calibration: Calibration) -> dict[int, Labels]:
    """Read the labels of a sequence by frame number; frames without a row are not in it.

    Raises:
        LabelError: The file or one of its rows cannot be read.
    """
    rows = read_object_rows([path], heads=2, allows_more=True)
    frames = rows.heads[:, 0]
    numbers = dict.fromkeys(frames.tolist())
    return {number: _to_labels(rows[frames == number], calibration) for number in numbers}


def read_object_labels(path: Path, calibration: Calibration) -> Labels:
    """Read the labels of one frame; its track ids are -1.

    Raises:
        LabelError: The file or one of its rows cannot be read.
    """
    return _to_labels(read_object_rows([path], allows_more=True), calibration)


def empty_labels() -> Labels:
    """Return the labels of a frame without labelled objects."""
    empty = np.zeros(0)
    return Labels(
        boxes_velo=Boxes3D.empty(),
        boxes_px=np.zeros((0, 4)),
        types=np.zeros(0, np.str_),
        track_ids=np.zeros(0, np.int64),
        truncation=empty,
        occlusion=np.zeros(0, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )


def _to_labels(rows: ObjectRows, calibration: Calibration) -> Labels:
    is_object = rows.types != DONT_CARE
    objects = rows.numbers[is_object]
    track_ids = rows.heads[:, 1] if rows.heads.shape[1] else np.full(len(rows), -1)
    return Labels(
        boxes_velo=_boxes_from_cam(objects[:, 7:14], calibration),
        boxes_px=objects[:, 3:7],
        types=rows.types[is_object],
        track_ids=track_ids[is_object],
        truncation=objects[:, 0],
        occlusion=objects[:, 1].astype(np.int64),
        dont_care_px=rows.numbers[~is_object, 3:7],
    )


def _boxes_from_cam(columns: Float64, calibration: Calibration) -> Boxes3D:
    """Move boxes given as h w l x y z ry into the LiDAR frame."""
    # A true inverse: the rotations of the files are orthonormal to their printed digits only.
    velo_SE3_cam = np.linalg.inv(calibration.cam_SE3_velo)
    return Boxes3D(
        bottom_m=columns[:, 3:6] @ velo_SE3_cam[:3, :3].T + velo_SE3_cam[:3, 3],
        size_m=columns[:, [2, 1, 0]],
        yaw_rad=wrap(-columns[:, 6] - np.pi / 2),
    )


def boxes_to_cam(boxes_velo: Boxes3D, calibration: Calibration) -> Float64:
    """Return (M, 7) h w l x y z ry: the inverse of `_boxes_from_cam`."""
    cam_SE3_velo = calibration.cam_SE3_velo
    bottom_cam = boxes_velo.bottom_m @ cam_SE3_velo[:3, :3].T + cam_SE3_velo[:3, 3]
    heading = wrap(-boxes_velo.yaw_rad - np.pi / 2)
    return np.column_stack([boxes_velo.size_m[:, ::-1], bottom_cam, heading])


def format_tracking_labels(frame: int, labels: Labels, calibration: Calibration) -> str:
    """Return the rows of one frame of a sequence, each with its line end."""
    ids = [*labels.track_ids.tolist(), *[-1] * len(labels.dont_care_px)]
    rows = _format_rows(labels, calibration, is_tracking=True)
    return "".join(f"{frame} {track} {row}\n" for track, row in zip(ids, rows, strict=True))


def format_object_labels(labels: Labels, calibration: Calibration) -> str:
    """Return the rows of an object frame, each with its line end."""
    return "".join(f"{row}\n" for row in _format_rows(labels, calibration, is_tracking=False))


def _format_rows(labels: Labels, calibration: Calibration, *, is_tracking: bool) -> list[str]:
    columns = boxes_to_cam(labels.boxes_velo, calibration)
    alphas = observation_angles_rad(labels.boxes_velo)
    numbers = np.column_stack([alphas, labels.boxes_px, columns])
    truncations = [f"{t:.0f}" if is_tracking else f"{t:.2f}" for t in labels.truncation]
    rows = [
        f"{kind} {truncation} {occlusion} {' '.join(f'{number:.6f}' for number in row)}"
        for kind, truncation, occlusion, row in zip(
            labels.types, truncations, labels.occlusion, numbers, strict=True
        )
    ]
    nowhere = "-1000 -1000 -1000 -10 -1 -1 -1" if is_tracking else "-1 -1 -1 -1000 -1000 -1000 -10"
    regions = [" ".join(f"{edge:.6f}" for edge in region) for region in labels.dont_care_px]
    return rows + [f"{DONT_CARE} -1 -1 -10 {region} {nowhere}" for region in regions]


def require_tracking_labels(
    root: Path, file: Path | None, calibration: Calibration | None, advice: str
) -> dict[int, Labels]:
    """Read the labels of a drive that must have some, and a camera to place them, by frame number.

    Args:
        root: Folder of the drive, for error messages.
        file: Labels in tracking format, or None.
        calibration: Calibration of the camera, or None.
        advice: What to do without a calibration.

    Raises:
        DriveError: There are no labels.
        CalibrationError: There is no camera calibration.
        LabelError: The labels cannot be read.
    """
    if file is None:
        raise DriveError(root, expected="a drive with labels", found="none")
    if calibration is None:
        raise CalibrationError(
            root,
            expected=f"a camera calibration, to place the labels of {file}",
            found="none",
            advice=advice,
        )
    return read_tracking_labels(file, calibration)
