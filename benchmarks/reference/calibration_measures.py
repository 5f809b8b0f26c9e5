"""Other measures of a calibration: mutual information of reflectance and grey values, and the agreement of detectors."""

from collections.abc import Sequence

import cv2
import numpy as np

from perception.detection.config import DetectionConfig
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.nms_fusion import NmsFusion
from perception.detection.networks import open_detectors
from perception.geometry.box_overlap_px import iou_px
from perception.geometry.camera import project
from perception.geometry.se3 import from_motion_vector
from perception.health.miscalibration import corrected
from perception.maps.densify import densify
from perception.maps.projection import project_frame
from perception.types import Float64, Frame

_BINS = 32
_NEAREST_M, _MIN_SCORE, _MIN_IOU = 1.0, 0.3, 0.4


def mutual_information(frames: Sequence[Frame], offset: Float64) -> float:
    """Return the mutual information of reflectance and grey values of all returns in view (Pandey et al., 2012).

    Args:
        frames: Frames with images and calibrations.
        offset: (6,) change of the calibration.
    """
    joint = np.zeros((_BINS, _BINS))
    for frame in frames:
        turned = corrected(frame, from_motion_vector(offset))
        assert turned.image is not None
        assert turned.calibration is not None
        grey = cv2.cvtColor(turned.image, cv2.COLOR_RGB2GRAY)
        pixels, depths_m = project(turned.calibration.image_P_velo, turned.points_velo)
        with np.errstate(invalid="ignore"):
            inside = (pixels >= 0).all(axis=1) & (pixels < np.array(grey.shape[::-1]) - 1).all(
                axis=1
            )
        used = inside & (depths_m > _NEAREST_M)
        columns, rows = np.rint(pixels[used]).astype(int).T
        values = turned.points_velo[used, 3], grey[rows, columns] / 256
        joint += np.histogram2d(*values, bins=_BINS, range=((0, 1), (0, 1)))[0]
    shares = joint / max(joint.sum(), 1)
    apart = shares.sum(axis=1, keepdims=True) * shares.sum(axis=0, keepdims=True)
    known = shares > 0
    return float((shares[known] * np.log(shares[known] / apart[known])).sum())


def detector_offsets_px(frames: Sequence[Frame], offset: Float64) -> Float64:
    """Return (M, 2) differences between the centres of boxes in the depth map and those of the image that they overlap.

    Args:
        frames: Frames with images and calibrations.
        offset: (6,) change of the calibration.
    """
    detector = MultimodalDetector(
        open_detectors(DetectionConfig(modalities=("rgb", "dm"))), NmsFusion(0.5)
    )
    differences = [np.zeros((0, 2))]
    for frame in frames:
        turned = corrected(frame, from_motion_vector(offset))
        found = detector.detect(turned, densify(project_frame(turned))).scene.modality_detections
        image, depth = (
            found[name].boxes_px[found[name].scores > _MIN_SCORE] for name in ("rgb", "dm")
        )
        if not (len(image) and len(depth)):
            continue
        overlaps = iou_px(depth, image)
        best = overlaps.argmax(axis=1)
        matched = overlaps.max(axis=1) > _MIN_IOU
        gaps = depth[matched] - image[best[matched]]
        differences.append((gaps[:, :2] + gaps[:, 2:]) / 2)
    return np.concatenate(differences)
