"""Labels of objects around the vehicle as labels of the image: those that the camera sees, with their boxes there."""

from dataclasses import replace

import numpy as np

from data.kitti.labels import empty_labels
from data.labelled_objects import box_owners
from data.recorded_drive import RecordedDrive
from perception.geometry.box_overlap_px import area_px
from perception.geometry.camera import box_outlines_px
from perception.maps.projection import VIRTUAL_CAMERA
from perception.types import Calibration, Float32, Float64, Int, Labels

_UNKNOWN_OCCLUSION = 3
# Visible shares of KITTI's levels 0 and 1, as in the labels of synthetic drives.
_VISIBLE_SHARE, _PARTLY_SHARE = 0.85, 0.45
_SAMPLES = 16  # of a box in each direction


def labels_of_camera(around: Labels | None, drive: RecordedDrive, index: int) -> Labels:
    """Return the labels of a frame in the view of the drive's camera, of the virtual one without a camera.

    Args:
        around: Labels of the objects around; None of a frame that is not labelled, whose image is DontCare.
        drive: Drive of the frame.
        index: Index of the frame.
    """
    calibration = drive.calibration or VIRTUAL_CAMERA
    if around is None:
        size_px = calibration.image_size_px
        image_px = np.array([] if size_px is None else [0.0, 0.0, *size_px]).reshape(-1, 4)
        return replace(empty_labels(), dont_care_px=image_px)
    return labels_in_view(around, calibration, drive.points_velo(index))


def labels_in_view(labels: Labels, calibration: Calibration, points_velo: Float32) -> Labels:
    """Return the labels whose boxes reach into the image, with their boxes there and the share of these beyond it.

    The occlusion is an estimate: by the boxes of nearer objects, and 3 (unknown, which no benchmark counts) where no
    point lies in the box. What else hides an object is not known.

    Args:
        labels: Labels of the objects around.
        calibration: Calibration with the size of the image.
        points_velo: (N, 4) points of the scan.
    """
    projection, size_px = calibration.image_P_velo, calibration.image_size_px
    boxes_px = box_outlines_px(projection, labels.boxes_velo, size_px)
    is_seen = np.asarray(np.isfinite(boxes_px).all(axis=1))
    whole_px = area_px(box_outlines_px(projection, labels.boxes_velo))[is_seen]
    seen = replace(labels[is_seen], boxes_px=boxes_px[is_seen])
    has_points = np.isin(np.arange(len(seen)), box_owners(seen.boxes_velo, points_velo))
    return replace(
        seen,
        truncation=np.clip(1 - area_px(seen.boxes_px) / whole_px, 0, 1),
        occlusion=np.where(has_points, _occlusion(seen, calibration), _UNKNOWN_OCCLUSION),
    )


def _occlusion(seen: Labels, calibration: Calibration) -> Int:
    """Return the (M,) levels of KITTI by the share of each box that nearer ones leave visible."""
    depths_m = seen.boxes_velo.bottom_m @ calibration.cam_SE3_velo[2, :3]
    shares = np.ones(len(seen))
    for row, box_px in enumerate(seen.boxes_px):
        nearer_px = seen.boxes_px[depths_m < depths_m[row]]
        shares[row] = 1 - _covered_share(box_px, nearer_px)
    return np.select([shares >= _VISIBLE_SHARE, shares >= _PARTLY_SHARE], [0, 1], 2)


def _covered_share(box_px: Float64, others_px: Float64) -> float:
    """Return the share of a box that others cover, on a grid of samples."""
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    columns, rows = (box_px[k] + steps * (box_px[k + 2] - box_px[k]) for k in (0, 1))
    in_columns = (columns >= others_px[:, [0]]) & (columns < others_px[:, [2]])
    in_rows = (rows >= others_px[:, [1]]) & (rows < others_px[:, [3]])
    return float((in_rows[:, :, None] & in_columns[:, None]).any(axis=0).mean())
