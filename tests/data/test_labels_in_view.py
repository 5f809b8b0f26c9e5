"""Labels of everything around, as those of one image."""

import numpy as np
import pytest

from data.labels_in_view import labels_in_view
from perception.types import Boxes3D, Calibration, Labels

# 90 degrees wide, looking along x; 100 x 50 pixels.
CAMERA = Calibration(
    image_P_cam=np.array([[50.0, 0, 50, 0], [0, 50, 25, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    image_size_px=(100, 50),
)


def labels(*bottoms_m: tuple[float, float, float]) -> Labels:
    """Return cubes of two metres."""
    count = len(bottoms_m)
    return Labels(
        boxes_velo=Boxes3D(np.array(bottoms_m), np.full((count, 3), 2.0), np.zeros(count)),
        boxes_px=np.full((count, 4), -1.0),
        types=np.full(count, "Car"),
        track_ids=np.arange(count),
        truncation=np.zeros(count),
        occlusion=np.full(count, 3),
        dont_care_px=np.zeros((0, 4)),
    )


def test_boxes_behind_and_beside_are_left_out():
    seen = labels_in_view(labels((11, 0, -1), (-11, 0, -1), (11, 30, -1), (21, 0, -1)), CAMERA)
    assert seen.track_ids.tolist() == [0, 3]


def test_a_box_ahead_has_the_outline_of_its_front():
    seen = labels_in_view(labels((11, 0, -1)), CAMERA)
    # Its front is 10 m away: two metres are ten pixels.
    np.testing.assert_allclose(seen.boxes_px, [[45, 20, 55, 30]])
    assert seen.truncation.tolist() == [0.0]


def test_a_box_at_the_border_is_cut():
    seen = labels_in_view(labels((11, 10, -1)), CAMERA)
    # 9 to 11 m to the left at 10 to 12 m: columns -5 to 12.5, of which those from 0 on are in the image.
    assert seen.boxes_px[0, 0] == 0
    assert seen.boxes_px[0, 2] == pytest.approx(12.5)
    assert seen.truncation[0] == pytest.approx(5 / 17.5)


def test_no_label_is_no_label():
    assert len(labels_in_view(labels((-11, 0, -1)), CAMERA)) == 0
