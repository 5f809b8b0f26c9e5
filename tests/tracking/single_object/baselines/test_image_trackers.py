import ctypes

import cv2
import numpy as np
import pytest

from perception.errors import PerceptionError, UsageError
from perception.sensor import HDL_64E
from perception.tracking.single_object.baselines.histogram_finders import (
    BackProjectionFinder,
    CorrectedHistogramFinder,
)
from perception.tracking.single_object.baselines.image_trackers import (
    ImageOnlyTracker,
    OpenCvFinder,
    missing_opencv_trackers,
    opencv_tracker,
)
from perception.tracking.single_object.tracker import TrackerInput, TrackStatus
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import Boxes3D

# A camera at the LiDAR's place: 100 px focal length, an image of 320 x 200 px.
IMAGE_P_VELO = np.array([[160.0, -100, 0, 0], [100.0, 0, -100, 0], [1.0, 0, 0, 0]])
BOX = Boxes3D(np.array([[10.0, 0, -2]]), np.array([[1e-6, 4.0, 4.0]]), np.zeros(1))
NAMES = ("ms-i", "cbwh", "opencv-mil")


@pytest.fixture(autouse=True)
def the_same_draws():
    """MIL draws from the generators of the C library and of OpenCV, of which a process has but one each."""
    ctypes.CDLL(None).srand(0)
    cv2.setRNGSeed(0)


def image_with_square(column: int, row: int) -> np.ndarray:
    """A red and blue square of 41 x 41 pixels on a grey checkerboard."""
    image = np.full((200, 320, 3), 80, np.uint8)
    image[:, ::2] = 140
    image[max(row - 20, 0) : row + 21, max(column - 20, 0) : column + 21] = (220, 20, 20)
    image[max(row - 5, 0) : row + 6, max(column - 20, 0) : column + 21] = (20, 20, 220)
    return image


def tracker_input(image: np.ndarray | None, frame: int = 0) -> TrackerInput:
    no_points = np.zeros((0, 4), np.float32)
    return TrackerInput(0.1 * frame, no_points, np.eye(4), None, image, IMAGE_P_VELO)


def center_of(box_px: np.ndarray) -> np.ndarray:
    return (box_px[:2] + box_px[2:]) / 2


@pytest.mark.parametrize("name", NAMES)
def test_it_begins_with_the_rectangle_around_the_box(name):
    first = single_object_tracker(name, HDL_64E).init(
        tracker_input(image_with_square(160, 100)), BOX
    )
    assert first.status is TrackStatus.SEEN
    assert first.box_velo is None
    np.testing.assert_allclose(first.box_px, [140, 80, 180, 120], atol=1e-3)
    np.testing.assert_array_equal(first.velocity_m_s, [0, 0])


@pytest.mark.parametrize(("name", "within_px"), [("ms-i", 1.5), ("cbwh", 2), ("opencv-mil", 6)])
def test_it_follows_a_square_over_a_checkerboard(name, within_px):
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(tracker_input(image_with_square(160, 100)), BOX)
    for frame in range(1, 8):
        position = 160 + 4 * frame, 100 - 2 * frame
        tracked = tracker.update(tracker_input(image_with_square(*position), frame))
        assert tracked.status is TrackStatus.SEEN
        assert np.hypot(*(center_of(tracked.box_px) - position)) <= within_px
        np.testing.assert_allclose(tracked.box_px[2:] - tracked.box_px[:2], 40, atol=1e-3)


@pytest.mark.parametrize("name", ["ms-i", "cbwh"])
def test_trackers_are_deterministic(name):
    def boxes() -> list[np.ndarray]:
        tracker = single_object_tracker(name, HDL_64E)
        tracker.init(tracker_input(image_with_square(160, 100)), BOX)
        images = [image_with_square(160 + 3 * i, 100) for i in range(1, 4)]
        return [tracker.update(tracker_input(image)).box_px for image in images]

    np.testing.assert_array_equal(boxes(), boxes())


@pytest.mark.parametrize("name", NAMES)
def test_without_images_it_is_predicted_then_lost_then_seen_again(name):
    tracker = single_object_tracker(name, HDL_64E)
    first = tracker.init(tracker_input(image_with_square(160, 100)), BOX)
    states = []
    for _ in range(12):
        tracked = tracker.update(tracker_input(None))
        np.testing.assert_array_equal(tracked.box_px, first.box_px)
        states.append(tracked.status)
    assert states == [TrackStatus.PREDICTED] * 10 + [TrackStatus.LOST] * 2
    again = tracker.update(tracker_input(image_with_square(162, 101)))
    assert again.status is TrackStatus.SEEN
    assert np.hypot(*(center_of(again.box_px) - (162, 101))) < 6


@pytest.mark.parametrize("name", ["ms-i", "cbwh"])
def test_an_object_without_its_colours_is_lost(name):
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(tracker_input(image_with_square(160, 100)), BOX)
    tracked = tracker.update(tracker_input(np.full((200, 320, 3), 255, np.uint8)))
    assert tracked.status is TrackStatus.PREDICTED
    np.testing.assert_allclose(tracked.box_px, [140, 80, 180, 120], atol=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_an_object_that_leaves_the_image_gives_no_nan(name):
    tracker = single_object_tracker(name, HDL_64E)
    tracker.init(tracker_input(image_with_square(160, 100)), BOX)
    for frame in range(1, 12):
        tracked = tracker.update(tracker_input(image_with_square(max(160 - 20 * frame, -21), 100)))
        assert np.isfinite(tracked.box_px).all()
        assert (tracked.box_px[2:] > tracked.box_px[:2]).all()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("color", [0, 128, 255])
def test_an_image_of_one_colour_gives_no_nan(name, color):
    tracker = single_object_tracker(name, HDL_64E)
    flat = np.full((200, 320, 3), color, np.uint8)
    tracker.init(tracker_input(flat), BOX)
    assert np.isfinite(tracker.update(tracker_input(flat)).box_px).all()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("size_m", "bottom_m"),
    [
        ([1e-6, 0.05, 0.05], [10.0, 0, 0]),
        ([1.0, 60.0, 40.0], [10.0, 0, -20]),
        ([1e-6, 4.0, 4.0], [10.0, 15.5, -2]),
    ],
    ids=["half a pixel", "larger than the image", "at its border"],
)
def test_odd_initial_boxes_work(name, size_m, bottom_m):
    box = Boxes3D(np.array([bottom_m]), np.array([size_m]), np.zeros(1))
    tracker = single_object_tracker(name, HDL_64E)
    first = tracker.init(tracker_input(image_with_square(160, 100)), box)
    tracked = tracker.update(tracker_input(image_with_square(161, 100)))
    assert np.isfinite(tracked.box_px).all()
    np.testing.assert_allclose(
        tracked.box_px[2:] - tracked.box_px[:2], first.box_px[2:] - first.box_px[:2]
    )


@pytest.mark.parametrize(
    ("box", "image", "found"),
    [
        (BOX, None, "none"),
        (Boxes3D(-BOX.bottom_m, BOX.size_m, BOX.yaw_rad), "there", "one outside the image"),
        (Boxes3D(BOX.bottom_m, 0 * BOX.size_m, BOX.yaw_rad), "there", "10 0 -2 0 0 0 0"),
        (Boxes3D.empty(), "there", "0 boxes"),
    ],
    ids=["no image", "behind", "no size", "no box"],
)
def test_an_unusable_first_frame_is_an_error(box, image, found):
    tracker = single_object_tracker("ms-i", HDL_64E)
    with pytest.raises(PerceptionError) as caught:
        tracker.init(tracker_input(None if image is None else image_with_square(160, 100)), box)
    assert caught.value.found == found


def test_an_update_before_init_fails():
    with pytest.raises(PerceptionError) as caught:
        single_object_tracker("cbwh", HDL_64E).update(tracker_input(image_with_square(160, 100)))
    assert caught.value.expected == "a call of init before update"


def test_a_colour_shared_with_the_surroundings_is_corrected_away():
    # Half of the object is of the background's grey, and a band beside it is all of that grey.
    image = np.full((200, 320, 3), 80, np.uint8)
    image[80:121, 140:161] = (220, 20, 20)
    finder = CorrectedHistogramFinder()
    finder.init(image, np.array([140.0, 80, 180, 120]))
    shares = np.sort(finder.shares)[::-1]
    # Grey is the only colour around, hence also the rarest there: nothing tells how common it may be.
    assert shares[0] == pytest.approx(shares[:2].sum() - shares[1])
    image[60:70] = (20, 220, 20)  # a rare colour around the object is the measure of the others
    finder.init(image, np.array([140.0, 80, 180, 120]))
    assert np.sort(finder.shares)[-1] > 0.8


def test_a_tracker_that_opencv_lacks_is_an_error_naming_its_wheel(monkeypatch):
    monkeypatch.delattr(cv2, "TrackerKCF_create", raising=False)
    assert "opencv-kcf" in missing_opencv_trackers()
    with pytest.raises(UsageError) as caught:
        opencv_tracker("opencv-kcf")
    assert caught.value.where == "tracker opencv-kcf"
    assert "opencv-contrib-python-headless" in caught.value.advice


def test_the_headless_wheel_brings_mil():
    assert set(NAMES) <= set(TRACKERS)


class GrowingTracker:
    """Finds a window twice as large, then nothing, as OpenCV's trackers may."""

    def __init__(self) -> None:
        self.answers = [(True, (100, 60, 80, 80)), (False, (0, 0, 0, 0))]

    def init(self, image: np.ndarray, window: tuple[int, int, int, int]) -> None:
        assert window == (140, 80, 40, 40)

    def update(self, image: np.ndarray) -> tuple[bool, tuple[int, int, int, int]]:
        return self.answers.pop(0)


def test_the_rectangle_grows_with_opencvs_window_and_stays_where_it_fails():
    tracker = ImageOnlyTracker("growing", OpenCvFinder(GrowingTracker))
    image = image_with_square(160, 100)
    tracker.init(tracker_input(image), BOX)
    grown = tracker.update(tracker_input(image))
    np.testing.assert_allclose(grown.box_px, [100, 60, 180, 140], atol=1e-3)
    missed = tracker.update(tracker_input(image))
    assert missed.status is TrackStatus.PREDICTED
    np.testing.assert_array_equal(missed.box_px, grown.box_px)


def test_back_projection_moves_by_whole_pixels_and_keeps_the_size():
    finder = BackProjectionFinder()
    finder.init(image_with_square(160, 100), np.array([140.25, 80.25, 179.25, 119.25]))
    found = finder.find(image_with_square(165, 97))
    np.testing.assert_allclose(found, [145.25, 77.25, 184.25, 116.25], atol=2)
    np.testing.assert_allclose(found[2:] - found[:2], 39)
