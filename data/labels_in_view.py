"""Labels of objects around the vehicle as labels of the image: those that the camera sees, with their boxes there."""

from dataclasses import replace

import numpy as np

from perception.geometry.box_overlap_px import area_px
from perception.geometry.camera import box_outlines_px
from perception.types import Calibration, Labels


def labels_in_view(labels: Labels, calibration: Calibration) -> Labels:
    """Return the labels whose boxes reach into the image, with their boxes there and the share of these beyond it.

    What hides an object is not known.

    Args:
        labels: Labels of the objects around.
        calibration: Calibration with the size of the image.
    """
    projection, size_px = calibration.image_P_velo, calibration.image_size_px
    boxes_px = box_outlines_px(projection, labels.boxes_velo, size_px)
    is_seen = np.asarray(np.isfinite(boxes_px).all(axis=1))
    whole_px = area_px(box_outlines_px(projection, labels.boxes_velo))[is_seen]
    seen = replace(labels[is_seen], boxes_px=boxes_px[is_seen])
    return replace(seen, truncation=np.clip(1 - area_px(seen.boxes_px) / whole_px, 0, 1))
