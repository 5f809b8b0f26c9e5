"""Each rule of KITTI's 2D tracking protocol on one or two boxes."""

import numpy as np
import pytest

from perception.errors import PerceptionError, UsageError
from perception.evaluation.multi_object.kitti_protocol import ImageBoxes, kitti_frames
from tests.faults import fault

BOX = (100.0, 100.0, 150.0, 150.0)
FAR = (400.0, 100.0, 450.0, 150.0)


def boxes(*rows: tuple, frames: list[int] | None = None) -> ImageBoxes:
    """Return what the protocol reads; a row is id, type, truncation, occlusion, box."""
    columns = list(zip(*rows, strict=True)) or [()] * 5
    return ImageBoxes(
        np.array(frames if frames is not None else [0] * len(rows), int),
        np.array(columns[0], int),
        np.array(columns[1], np.str_),
        np.array(columns[2], float),
        np.array(columns[3], float),
        np.array(columns[4], float).reshape(-1, 4),
    )


def prediction(track: int, box: tuple, name: str = "Car") -> tuple:
    return (track, name, -1, -1, box)


def evaluated(
    truth: ImageBoxes, predictions: ImageBoxes, name: str = "car"
) -> tuple[list[int], list[int]]:
    """Return the ids of truths and tracks that are evaluated in the only frame."""
    (frame,) = kitti_frames(truth, predictions, name, 1)
    return frame.truth_ids.tolist(), frame.track_ids.tolist()


def low(height: float, box: tuple = FAR) -> tuple:
    return (box[0], box[1], box[2], box[1] + height)


@pytest.mark.parametrize(
    ("label", "predicted", "expected"),
    [
        ((1, "Car", 0, 0, BOX), BOX, ([1], [7])),
        ((1, "CAR", 0, 2, BOX), BOX, ([1], [7])),
        ((1, "Car", 0, 3, BOX), BOX, ([], [])),
        ((1, "Car", 1, 0, BOX), BOX, ([], [])),
        ((1, "Car", 1, 0, BOX), FAR, ([], [7])),
        ((1, "Van", 0, 0, BOX), BOX, ([], [])),
        ((1, "Van", 0, 0, BOX), FAR, ([], [7])),
        ((1, "Truck", 0, 0, BOX), BOX, ([], [7])),
        ((-1, "Car", 0, 0, BOX), BOX, ([], [7])),
        ((-1, "Van", 0, 0, BOX), BOX, ([], [7])),
    ],
    ids=[
        "the class itself",
        "without case, largely occluded",
        "occlusion unknown: neither label nor prediction",
        "truncated: neither label nor prediction",
        "truncated: a prediction elsewhere is evaluated",
        "neighbour: the prediction matched to it is left out",
        "neighbour: a prediction elsewhere is evaluated",
        "another class is not looked at",
        "a row without an id is dropped",
        "a neighbour without an id too",
    ],
)
def test_labels(label, predicted, expected):
    assert evaluated(boxes(label), boxes(prediction(7, predicted))) == expected


@pytest.mark.parametrize("name", ["Person", "Person_sitting"])
def test_who_sits_is_no_pedestrian(name):
    truth = boxes((1, name, 0, 0, BOX))
    assert evaluated(truth, boxes(prediction(7, BOX, "Pedestrian")), "pedestrian") == ([], [])
    assert evaluated(truth, boxes(prediction(7, BOX)), "car") == ([], [7])


def test_tracks_of_another_class_or_without_id_do_not_count():
    predictions = boxes(prediction(7, BOX, "Van"), prediction(-1, BOX), prediction(8, BOX, "car"))
    assert evaluated(boxes((1, "Car", 0, 0, BOX)), predictions) == ([1], [8])


@pytest.mark.parametrize(
    ("height", "is_evaluated"), [(25.0, False), (25.01, True), (10, False)], ids=str
)
def test_unmatched_tracks_must_be_higher_than_25_pixels(height, is_evaluated):
    tracks = evaluated(boxes(), boxes(prediction(7, low(height))))[1]
    assert tracks == ([7] if is_evaluated else [])


def test_matched_boxes_may_be_low():
    truth = boxes((1, "Car", 0, 0, low(10)))
    assert evaluated(truth, boxes(prediction(7, low(10)))) == ([1], [7])
    assert evaluated(truth, boxes()) == ([1], [])


@pytest.mark.parametrize(
    ("regions", "is_evaluated"),
    [
        ([(400, 100, 425, 150)], True),
        ([(400, 100, 425.1, 150)], False),
        ([(400, 100, 420, 150), (420, 100, 440, 150)], True),
        ([(300, 0, 900, 900)], False),
        ([], True),
    ],
    ids=["half of it", "more than half", "two that are half together", "a huge one", "none"],
)
def test_unmatched_tracks_in_dont_care_regions_are_left_out(regions, is_evaluated):
    truth = boxes(*((-1, "DontCare", -1, -1, region) for region in regions))
    assert evaluated(truth, boxes(prediction(7, FAR)))[1] == ([7] if is_evaluated else [])


def test_matched_tracks_may_lie_in_dont_care_regions():
    truth = boxes((1, "Car", 0, 0, BOX), (-1, "DontCare", -1, -1, (0, 0, 900, 900)))
    assert evaluated(truth, boxes(prediction(7, BOX))) == ([1], [7])


def test_a_track_matches_the_label_of_the_largest_overlap():
    truth = boxes((1, "Car", 0, 0, BOX), (2, "Van", 0, 0, (105.0, 100.0, 155.0, 150.0)))
    on_car = boxes(prediction(7, (101.0, 100.0, 151.0, 150.0)))
    assert evaluated(truth, on_car) == ([1], [7])
    on_van = boxes(prediction(7, (104.0, 100.0, 154.0, 150.0)))
    assert evaluated(truth, on_van) == ([1], [])


def test_two_tracks_are_matched_for_the_largest_sum():
    # Alone, each would go to the car; together, the second must take the van.
    truth = boxes((1, "Car", 0, 0, BOX), (2, "Van", 0, 0, (120.0, 100.0, 170.0, 150.0)))
    both = boxes(
        prediction(7, (98.0, 100.0, 148.0, 150.0)), prediction(8, (105.0, 100.0, 155.0, 150.0))
    )
    assert evaluated(truth, both) == ([1], [7])


def test_half_an_overlap_is_enough_and_less_is_not():
    wide = boxes((1, "Van", 0, 0, BOX))
    assert evaluated(wide, boxes(prediction(7, (100.0, 100.0, 150.0, 200.0))))[1] == []
    assert evaluated(wide, boxes(prediction(7, (100.0, 100.0, 150.0, 200.5))))[1] == [7]


def test_frames_are_separate_and_rows_may_be_in_any_order():
    truth = boxes((1, "Car", 0, 0, BOX), (1, "Car", 0, 0, FAR), frames=[2, 0])
    predictions = boxes(prediction(7, FAR), prediction(8, BOX), frames=[0, 2])
    first, second, third = kitti_frames(truth, predictions, "car", 3)
    assert (first.track_ids.tolist(), third.track_ids.tolist()) == ([7], [8])
    assert second.similarity.shape == (0, 0)
    assert first.similarity.tolist() == third.similarity.tolist() == [[1]]


def test_what_cannot_be_evaluated():
    with fault(UsageError, expected="one of car, pedestrian, cyclist", found="'tram'"):
        kitti_frames(boxes(), boxes(), "tram", 1)
    with fault(PerceptionError, expected="0 to 0", found="0 to 3"):
        kitti_frames(
            boxes(), boxes(prediction(1, BOX), prediction(1, BOX), frames=[0, 3]), "car", 1
        )
    assert kitti_frames(boxes(), boxes(), "car", 0) == []
