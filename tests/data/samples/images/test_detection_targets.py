"""Which labels are learned, which are ignored, and which are left out."""

import numpy as np
import pytest

from data.samples.images.targets import DetectionTargets, detection_targets, labels_within_image
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import PixelRectangle, place
from perception.types import Boxes3D, Labels

SIZE_PX = (640, 192)
PLACEMENT = place(PixelRectangle(0, 0, *SIZE_PX), InputSize(96, 320))
BOX = (100.0, 50.0, 160.0, 90.0)


def labelled(*rows: tuple[object, ...], dont_care: tuple[tuple[float, ...], ...] = ()) -> Labels:
    """Return labels of rows: type, truncation, occlusion, box."""
    count = len(rows)
    return Labels(
        boxes_velo=Boxes3D(np.zeros((count, 3)), np.ones((count, 3)), np.zeros(count)),
        boxes_px=np.array([row[3] for row in rows], np.float64).reshape(-1, 4),
        types=np.array([row[0] for row in rows], np.str_),
        track_ids=np.full(count, -1),
        truncation=np.array([row[1] for row in rows], np.float64),
        occlusion=np.array([row[2] for row in rows], np.int64),
        dont_care_px=np.array(dont_care, np.float64).reshape(-1, 4),
    )


def targets(labels: Labels, *class_names: str) -> DetectionTargets:
    return detection_targets(labels, class_names or ("Car",), PLACEMENT)


def test_boxes_are_in_pixels_of_the_input_and_within_it():
    labels = labelled(("Car", 0, 0, BOX), ("Car", 0.4, 0, (-20.0, 60.0, 50.0, 230.0)))
    found = targets(labels)
    np.testing.assert_allclose(found.boxes_px, [[50, 25, 80, 45], [0, 30, 25, 96]])
    assert found.boxes_px.dtype == np.float32
    assert found.is_ignored.tolist() == [False, False]
    assert found.min_height_px == 8  # 16 in the original


@pytest.mark.parametrize(
    ("row", "is_ignored"),
    [
        (("Car", 0.5, 2, BOX), False),
        (("Car", 0.51, 0, BOX), True),
        (("Car", 1, 0, BOX), True),  # tracking's level 1: more than half is outside
        (("Car", 0, 3, BOX), True),
        (("Car", 0, 0, (0.0, 0.0, 30.0, 16.0)), False),
        (("Car", 0, 0, (0.0, 0.0, 30.0, 15.9)), True),
        (("Van", 0, 0, BOX), True),
        (("car", 0, 0, BOX), False),
    ],
)
def test_who_is_hard_to_see_or_alike_is_ignored(row: tuple[object, ...], is_ignored: bool):
    assert targets(labelled(row)).is_ignored.tolist() == [is_ignored]


def test_other_types_are_background_and_regions_are_ignored():
    labels = labelled(("Truck", 0, 0, BOX), ("Car", 0, 0, BOX), dont_care=((0, 0, 64, 32),))
    found = targets(labels)
    np.testing.assert_allclose(found.boxes_px, [[50, 25, 80, 45], [0, 0, 32, 16]])
    assert found.is_ignored.tolist() == [False, True]


def test_classes_are_numbered_in_their_order_and_neighbours_can_be_classes():
    names = ["Car", "Van", "Pedestrian", "Person_sitting", "Tram"]
    labels = labelled(*((name, 0, 0, BOX) for name in names))
    found = targets(labels, "Pedestrian", "Van", "Car")
    assert found.classes.tolist() == [2, 1, 0, 0]
    assert found.is_ignored.tolist() == [False, False, False, True]


def test_a_frame_without_objects_has_no_labels():
    found = targets(labelled())
    assert (found.boxes_px.shape, found.classes.shape, len(found)) == ((0, 4), (0,), 0)


@pytest.mark.parametrize(
    "box",
    [
        (700.0, 50.0, 760.0, 90.0),
        (-90.0, 50.0, 0.0, 90.0),
        (100.0, 50.0, 100.0, 90.0),
        (160.0, 90.0, 100.0, 50.0),
    ],
)
def test_boxes_outside_the_image_are_left_out(box: tuple[float, ...]):
    labels = labelled(("Car", 0, 0, box), ("Car", 0, 0, BOX), dont_care=(box, (0, 0, 9, 9)))
    kept, left_out = labels_within_image(labels, SIZE_PX)
    assert left_out == 2
    np.testing.assert_array_equal(kept.boxes_px, [BOX])
    np.testing.assert_array_equal(kept.dont_care_px, [[0, 0, 9, 9]])
