"""Frames of a drive with boxes of ours, as the forms of labels write them."""

from pathlib import Path

import numpy as np

from data.box_labels.boxes import LabelledBox, LabelledFrame
from data.drive_images import ImageFiles
from data.file_drive import FileDrive
from data.folder.drive import FolderDrive
from data.recorded_drive import RecordedDrive
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.types import Float64, Int, Labels


def labelled_frame(
    drive: RecordedDrive,
    index: int,
    around: Labels,
    world_SE3_velo: Float64,
    in_image: Labels | None = None,
) -> LabelledFrame:
    """Return a frame with boxes in the axes of its scan.

    Args:
        drive: Drive of the frame.
        index: Index of the frame.
        around: Boxes in the LiDAR frame.
        world_SE3_velo: (4, 4) pose of the LiDAR.
        in_image: Boxes in the image, None without a camera.
    """
    velo_SE3_file = drive.velo_SE3_file(index) if isinstance(drive, FolderDrive) else np.eye(4)
    scan = _scan_file(drive, index)
    boxes = transform_boxes(inverse(velo_SE3_file), around.boxes_velo)
    numbers = np.column_stack([boxes.centers_m, boxes.size_m, boxes.yaw_rad])
    image, size_px = drive.images, (0, 0)
    file = image.file(index) if isinstance(image, ImageFiles) else None
    image_boxes: list[LabelledBox] = []
    if in_image is not None and drive.calibration is not None and drive.calibration.image_size_px:
        size_px = drive.calibration.image_size_px
        edges = np.clip(in_image.boxes_px / np.tile(size_px, 2), 0, 1)
        low, high = edges[:, :2], edges[:, 2:]
        count = len(edges)
        columns = [(low + high) / 2, np.zeros(count), high - low, np.ones(count), np.zeros(count)]
        is_inside = (high > low).all(axis=1)
        of_image = in_image[is_inside]
        image_boxes = _boxes(
            np.column_stack(columns)[is_inside], of_image.types, of_image.track_ids
        )
    return LabelledFrame(
        name=Path(scan).stem,
        number=drive.frame_numbers[index],
        scan=scan,
        boxes=_boxes(numbers, around.types, around.track_ids),
        world_SE3_file=world_SE3_velo @ velo_SE3_file,
        stamp_us=round(drive.stamp_s(index) * 1e6) + drive.origin_ns // 1000,
        image=None if file is None else file.name,
        size_px=size_px,
        image_boxes=image_boxes,
    )


def _scan_file(drive: RecordedDrive, index: int) -> str:
    """Return the name of the file of a scan; where many are in one, that of the frame."""
    is_packed = isinstance(drive, FolderDrive) and drive.recording is not None
    if isinstance(drive, FileDrive) and not is_packed:
        return drive.scans.paths[index].name
    return f"{drive.frame_names[index]}.pcd"


def _boxes(numbers: Float64, types: np.ndarray, ids: Int) -> list[LabelledBox]:
    rows = zip(numbers.tolist(), types.tolist(), ids.tolist(), strict=True)
    return [
        LabelledBox("a box", kind, str(track) if track >= 0 else "", tuple(row))
        for row, kind, track in rows
    ]
