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


NO_POINTS = np.zeros((0, 4), np.float32)


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
    seen = labels_in_view(
        labels((11, 0, -1), (-11, 0, -1), (11, 30, -1), (21, 0, -1)), CAMERA, NO_POINTS
    )
    assert seen.track_ids.tolist() == [0, 3]


def test_a_box_ahead_has_the_outline_of_its_front():
    seen = labels_in_view(labels((11, 0, -1)), CAMERA, NO_POINTS)
    # Its front is 10 m away: two metres are ten pixels.
    np.testing.assert_allclose(seen.boxes_px, [[45, 20, 55, 30]])
    assert seen.truncation.tolist() == [0.0]


def test_a_box_at_the_border_is_cut():
    seen = labels_in_view(labels((11, 10, -1)), CAMERA, NO_POINTS)
    # 9 to 11 m to the left at 10 to 12 m: columns -5 to 12.5, of which those from 0 on are in the image.
    assert seen.boxes_px[0, 0] == 0
    assert seen.boxes_px[0, 2] == pytest.approx(12.5)
    assert seen.truncation[0] == pytest.approx(5 / 17.5)


def test_no_label_is_no_label():
    assert len(labels_in_view(labels((-11, 0, -1)), CAMERA, NO_POINTS)) == 0


def test_boxes_are_hidden_by_nearer_ones_and_unknown_without_points():
    # A second cube 10 m behind the first is a ring of a third of its width around it; the third is behind both.
    found = labels((11, 0, -1), (21, 0.5, -1), (41, 0, -1), (31, -12, -1), (51, 25, -1))
    points = np.zeros((4, 4), np.float32)
    points[:, :2] = [(11, 0), (21, 0.5), (41, 0), (31, -12)]
    seen = labels_in_view(found, CAMERA, points)
    assert seen.occlusion.tolist() == [0, 2, 2, 0, 3]


def test_half_of_a_box_is_hidden_by_a_nearer_one_beside_it():
    # The front of the far one spans columns 45 to 55 at 10 m; the near one covers those from 50 on.
    near = labels((6, -1.0, -1), (11, 0, -1))
    points = np.array([(6, -1, 0, 0), (11, 0, 0, 0)], np.float32)
    assert labels_in_view(near, CAMERA, points).occlusion.tolist() == [0, 1]
