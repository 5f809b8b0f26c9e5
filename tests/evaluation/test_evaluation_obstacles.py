import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.confusion import Confusion, add_confusions
from perception.evaluation.objects import LabelledObjects, MotionState
from perception.evaluation.obstacle_measure import ObstacleMeasure
from perception.evaluation.obstacles import (
    ObjectObservations,
    count_objects,
    missed_moving,
    motion_by_length,
    motion_confusions,
    observe_objects,
)
from perception.geometry.grids import LocalArea
from perception.types import Boxes3D, Labels, PointState, PointTruth
from tests.faults import fault
from tests.known_result import TRACKS, known_result

AREA = LocalArea()
OUTSIDE, GROUND = PointState.OUTSIDE, PointState.GROUND
STATIC, MOVING = PointState.STATIC, PointState.MOVING
FOUR_POINTS = ObjectMatchConfig(min_points=4)


def three_objects(*motions: MotionState) -> LabelledObjects:
    """Return 2 m cubes on the ground at x = 5, 10 and 15, and one beyond the area at x = 40."""
    return LabelledObjects(
        boxes_velo=Boxes3D(
            np.array([[5, 0, -1.7], [10, 0, -1.7], [15, 0, -1.7], [40, 0, -1.7]]),
            np.full((4, 3), 2.0),
            np.zeros(4),
        ),
        motions=np.array([*motions, MotionState.MOVING]),
        track_ids=np.array([1, 2, 3, 4]),
    )


def points_on(x_m: float, states: list[int], height_m: float = 1.0) -> np.ndarray:
    """Return rows of x, y, z, reflectance, state: one point a state, side by side."""
    y_m = np.linspace(-0.5, 0.5, len(states))
    count = len(states)
    columns = [np.full(count, x_m), y_m, np.full(count, height_m - 1.7), np.zeros(count), states]
    return np.column_stack(columns)


def observe(rows: list[np.ndarray], objects: LabelledObjects) -> ObjectObservations:
    scan = np.concatenate(rows)
    return observe_objects(
        0, scan[:, :4], scan[:, 4].astype(np.uint8), objects, AREA, ObjectMatchConfig()
    )


def test_an_object_is_found_or_missed_by_its_own_points():
    objects = three_objects(MotionState.STATIC, MotionState.MOVING, MotionState.MOVING)
    observed = observe(
        [
            points_on(5, [STATIC] * 4),  # stands, found
            points_on(10, [MOVING, STATIC, STATIC, STATIC]),  # moves, found by a quarter
            points_on(15, [GROUND, GROUND, GROUND, MOVING]),  # moves, but taken for ground
            points_on(7.5, [MOVING] * 9),  # on no object
            points_on(40, [STATIC] * 9),  # an object beyond the area
            points_on(5, [GROUND] * 9, height_m=0.1),  # at its feet: ground by design
        ],
        objects,
    )
    assert observed.track_ids.tolist() == [1, 2, 3]
    assert observed.points.tolist() == [4, 4, 4]
    assert observed.obstacle_points.tolist() == [4, 4, 1]
    assert observed.moving_points.tolist() == [0, 1, 1]
    np.testing.assert_allclose(observed.boxes_velo.bottom_m[:, 0], [5, 10, 15])
    counts = count_objects(observed, FOUR_POINTS)
    assert (counts.objects, counts.missed_objects) == (3, 1)
    assert (counts.moving, counts.missed_moving) == (2, 0)
    assert (counts.static, counts.false_moving) == (1, 0)


def test_a_moving_object_called_static_is_missed_and_a_static_one_called_moving_is_false():
    observed = observe(
        [points_on(5, [MOVING] * 4), points_on(10, [STATIC] * 4), points_on(15, [STATIC] * 4)],
        three_objects(MotionState.STATIC, MotionState.MOVING, MotionState.UNKNOWN),
    )
    counts = count_objects(observed, FOUR_POINTS)
    assert (counts.moving, counts.missed_moving, counts.tracks_never_moving) == (1, 1, 1)
    assert (counts.static, counts.false_moving) == (1, 1)
    assert counts.objects == 3  # what is unknown is an obstacle still
    assert missed_moving(observed, FOUR_POINTS).track_ids.tolist() == [2]


def test_objects_with_few_points_do_not_count():
    observed = observe(
        [points_on(5, [STATIC] * 4), points_on(10, [GROUND] * 3)],
        three_objects(MotionState.STATIC, MotionState.STATIC, MotionState.STATIC),
    )
    assert count_objects(observed, FOUR_POINTS).objects == 1
    seen_at_all = count_objects(observed, ObjectMatchConfig(min_points=1))
    assert (seen_at_all.objects, seen_at_all.missed_objects) == (2, 1)


def test_a_track_is_found_where_one_of_its_frames_is():
    rows = np.arange(3)
    observed = ObjectObservations(
        frames=rows,
        track_ids=np.array([7, 7, 8]),
        motions=np.full(3, MotionState.MOVING),
        boxes_velo=Boxes3D(np.zeros((3, 3)), np.ones((3, 3)), np.zeros(3)),
        points=np.full(3, 50),
        obstacle_points=np.full(3, 50),
        moving_points=np.array([0, 40, 0]),
    )
    counts = count_objects(observed, ObjectMatchConfig())
    assert (counts.moving, counts.missed_moving) == (3, 2)
    assert (counts.moving_tracks, counts.tracks_never_moving) == (2, 1)


@pytest.mark.parametrize(("share", "found"), [(0.0, True), (0.25, True), (0.5, False)])
def test_the_share_that_must_move(share: float, found: bool):
    observed = observe(
        [points_on(5, [MOVING, STATIC, STATIC, STATIC])],
        three_objects(MotionState.MOVING, MotionState.MOVING, MotionState.MOVING),
    )
    assert observed.is_moving(share).tolist() == [found, False, False]


def test_no_object_is_counted_as_none():
    counts = count_objects(ObjectObservations.concatenate([]), ObjectMatchConfig())
    assert (counts.objects, counts.moving, counts.static) == (0, 0, 0)


def test_moving_and_static_points_by_hand():
    rows = [
        # state, class, moves
        (MOVING, 10, True),  # a car that drives
        (STATIC, 10, True),  # its roof, called static
        (STATIC, 50, False),  # a wall
        (MOVING, 50, False),  # another, called moving
        (GROUND, 10, True),  # a tyre
        (STATIC, 48, False),  # a kerb
        (GROUND, 40, False),  # road
        (OUTSIDE, 50, False),  # too high: does not count
        (STATIC, 0, False),  # unlabelled: does not count
    ]
    states, classes, moves = (np.array(column) for column in zip(*rows, strict=True))
    figures = motion_confusions(states.astype(np.uint8), classes, moves)
    assert figures["moving"] == Confusion(true_positives=1, false_positives=1, false_negatives=2)
    assert figures["static"] == Confusion(true_positives=1, false_positives=2, false_negatives=1)
    assert add_confusions(figures, figures)["moving"].iou == pytest.approx(2 / 8)


def test_labelled_objects_of_different_lengths_are_refused():
    with fault(PerceptionError, where="LabelledObjects.motions", expected="shape (0,)"):
        LabelledObjects(Boxes3D.empty(), np.zeros(1, np.int64), np.zeros(0, np.int64))


def test_moving_points_are_compared_by_the_length_of_their_object():
    sizes_m = np.array([[4.0, 1.8, 1.5], [16.0, 2.5, 3.8], [1.8, 0.6, 1.7]])
    boxes = Boxes3D(np.zeros((3, 3)), sizes_m, np.zeros(3))
    labels = Labels(
        boxes,
        boxes_px=np.zeros((3, 4)),
        types=np.array(["Car", "Truck", "Car"]),
        track_ids=np.array([0, 1, 2]),
        truncation=np.zeros(3),
        occlusion=np.zeros(3, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )
    states = np.array([MOVING, MOVING, STATIC, STATIC, GROUND, MOVING, MOVING], np.uint8)
    instances = np.array([1, 2, 2, 2, 2, 3, 0])
    truth = PointTruth(np.full(7, 18), instances, np.array([1, 1, 1, 1, 1, 0, 1], bool))
    assert motion_by_length(states, truth, labels.boxes_velo, labels.track_ids) == {
        "under 2 m": Confusion(0, 1, 0),
        "2 to 6 m": Confusion(1, 0, 0),
        "over 6 m": Confusion(1, 0, 2),
    }


class MovesFromFrame7:
    """Motion of an object that is static at first."""

    def of(self, frame: int, track_ids: np.ndarray) -> np.ndarray:
        return np.full(len(track_ids), MotionState.MOVING if frame >= 7 else MotionState.STATIC)

    def velocities_of(self, frame: int, track_ids: np.ndarray) -> np.ndarray:
        return np.full((len(track_ids), 2), 3.0 if frame >= 7 else 0.0)


def test_objects_of_a_drive_are_counted_by_points_shares_and_frames():
    labels = Labels(
        TRACKS.boxes[:1], np.array([[500.0, 150, 620, 240]]), np.array(["Van"]), TRACKS.ids[:1],
        np.zeros(1), np.zeros(1, np.int64), np.zeros((0, 4)),
    )  # fmt: skip
    config = ObjectMatchConfig(min_points=1, moving_share=0.3)
    measure = ObstacleMeasure(AREA, config, MovesFromFrame7())
    for index in (0, 7):  # its one point is called moving in both
        measure.update(known_result(index), labels, None)
    report = measure.compute()
    assert report.object_motions == {"4": "moving"}
    assert report.objects == report.objects_by_min_points["1 points and more"]
    assert (report.objects.moving, report.objects.static, report.objects.false_moving) == (1, 1, 1)
    by_points = {name: one.objects for name, one in report.objects_by_min_points.items()}
    assert by_points == {
        "1 points and more": 2, "5 points and more": 0, "50 points and more": 0,
    }  # fmt: skip
    assert list(report.objects_by_moving_share) == ["any", "10 %", "30 %", "50 %"]
    by_frames = {name: (one.static, one.moving) for name, one in report.objects_by_frames.items()}
    assert by_frames == {"first 1": (1, 0), "all others": (0, 1)}
    false = report.false_clusters["1 points and more"]
    assert (false.clusters, false.per_frame, false.on_static_objects) == (1, 0.5, 1)
    assert (false.in_warm_up, false.with_dont_care) == (1, 1)
    assert [(one.moving, one.obstacles) for one in report.counts.values()] == [(0, 1), (1, 1)]
    titles = [table.title for table in report.tables()]
    assert titles[0] == "Obstacles in the columns of Table 7.2, of labelled objects"
    assert titles[1] == "Labelled objects, once per frame; found moving at 30 % moving points"
    assert titles[2:4] == [
        "Labelled objects of 1 points and more, by required share of moving points",
        "Labelled objects of 1 points and more, by frames",
    ]
