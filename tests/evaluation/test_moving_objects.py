from dataclasses import replace

import numpy as np
import pytest

from perception.errors import PerceptionError, UsageError
from perception.evaluation.config import MovingObjectConfig
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks
from perception.evaluation.multi_object.track_assignment import (
    MovingScene,
    assign_tracks,
    is_target,
    points_above_bottom,
    similarity_by_distance,
    tracked_frame,
)
from perception.evaluation.multi_object.track_errors import (
    NO_TRACK,
    TargetErrors,
    TrackOutcomes,
    find_false_tracks,
    target_errors,
    track_outcomes,
)
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState
from perception.geometry.box_overlap import iou_bev
from perception.types import Boxes3D, Calibration, Tracks
from tests.faults import fault

CONFIG = MovingObjectConfig()
CAR_M = (4.0, 2.0, 1.5)
# A camera at the LiDAR that looks along +x: 100 x 100 pixels, 90 degrees wide.
CAMERA = Calibration(
    image_P_cam=np.array([[50.0, 0, 50, 0], [0, 50, 50, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    image_size_px=(100, 100),
)


def boxes_at(*places_m: tuple[float, float], size_m=CAR_M, yaw_rad: float = 0.0) -> Boxes3D:
    count = len(places_m)
    bottom_m = np.column_stack([np.reshape(places_m, (count, 2)), np.full(count, -1.0)])
    return Boxes3D(bottom_m, np.tile(size_m, (count, 1)), np.full(count, yaw_rad))


def scene_of(boxes: Boxes3D, motions=MotionState.MOVING, points=100, view=None, moves=True):
    count = len(boxes)
    return MovingScene(
        objects=LabelledObjects(boxes, np.full(count, motions), np.arange(10, 10 + count)),
        velocities_m_s=np.tile([5.0, 0.0], (count, 1)),
        moves_in_drive=np.full(count, moves),
        points=np.full(count, points),
        view=view,
    )


def tracks_of(boxes: Boxes3D, ids=None, velocity_m_s=(5.0, 0.0)) -> Tracks:
    count = len(boxes)
    return Tracks.unclassified(
        np.arange(count) if ids is None else np.asarray(ids),
        boxes,
        np.tile(velocity_m_s, (count, 1)).astype(float),
        np.ones(count, bool),
    )


def view_of(*dont_care_px: tuple[float, float, float, float]) -> LabelledView:
    return LabelledView(CAMERA, (100, 100), np.array(dont_care_px, float).reshape(-1, 4))


def scores_of(frames: list[tuple[MovingScene, Tracks]]) -> MotMetrics:
    by_overlap, by_distance = (
        evaluate_tracks(
            [
                tracked_frame(scene, tracks, assign_tracks(scene, tracks, CONFIG), similarity)
                for scene, tracks in frames
            ]
        )
        for similarity in (iou_bev, similarity_by_distance(CONFIG))
    )
    assert by_overlap.clear.false_positives >= by_distance.clear.false_positives
    return by_distance


def errors_over(frames: list[tuple[MovingScene, Tracks]]) -> TargetErrors:
    return TargetErrors.concatenate(
        target_errors(0.1 * number, scene, tracks, assign_tracks(scene, tracks, CONFIG))
        for number, (scene, tracks) in enumerate(frames)
    )


def driving(frames: int) -> list[tuple[MovingScene, Tracks]]:
    """Return a car that drives and a person that crosses, both tracked perfectly."""
    steps = [boxes_at((5.0 + 0.5 * n, 2.0), (12.0, -4.0 + 0.1 * n)) for n in range(frames)]
    return [(scene_of(boxes), tracks_of(boxes, [3, 8])) for boxes in steps]


def test_a_perfect_tracker_scores_one():
    frames = driving(12)
    scores = scores_of(frames)
    assert (scores.hota.hota.mean(), scores.clear.mota, scores.clear.motp) == (1.0, 1.0, 1.0)
    assert scores.identity.idf1 == 1.0
    errors = errors_over(frames)
    assert len(errors.matched) == len(errors) == 24
    values = errors.summary()
    assert (values.center_m, values.velocity_m_s, values.heading_rad) == (0.0, 0.0, 0.0)


def test_frames_before_a_tracker_is_sure_are_misses():
    frames = [
        (scene, tracks if n >= 3 else Tracks.empty())
        for n, (scene, tracks) in enumerate(driving(12))
    ]
    assert scores_of(frames).clear.false_negatives == 6
    errors, _ = errors_over(frames).by_object().values()
    assert (len(errors), len(errors.matched)) == (12, 9)
    assert errors.of_object("Car").time_to_first_track_s == pytest.approx(0.3)


def test_who_must_be_tracked():
    boxes = boxes_at((10, 0), (31, 0), (10, 11), (-5, 0))
    assert is_target(scene_of(boxes), CONFIG).tolist() == [True, False, False, True]
    assert not is_target(scene_of(boxes, points=19), CONFIG).any()
    assert not is_target(scene_of(boxes, MotionState.STATIC), CONFIG).any()
    in_view = is_target(scene_of(boxes, view=view_of()), CONFIG)
    assert in_view.tolist() == [True, False, False, False]
    # The bottom of a near box is below the image, its middle is in it.
    assert is_target(scene_of(boxes_at((0.8, 0)), view=view_of()), CONFIG).all()
    assert not is_target(scene_of(boxes_at((0.2, 0)), view=view_of()), CONFIG).any()


@pytest.mark.parametrize(
    ("changes", "is_excused"),
    [
        ({"points": 5}, True),  # hardly seen
        ({"motions": MotionState.UNKNOWN, "moves": False}, True),
        ({"motions": MotionState.STATIC}, True),  # stopped, or not yet moving
        ({"motions": MotionState.STATIC, "moves": False}, False),  # parked all the time
    ],
)
def test_tracks_of_objects_that_need_not_be_tracked(changes: dict, is_excused: bool):
    boxes = boxes_at((10, 0))
    assignment = assign_tracks(scene_of(boxes, **changes), tracks_of(boxes), CONFIG)
    assert len(assignment.targets) == 0
    assert assignment.ignored.tolist() == ([0] if is_excused else [])
    assert assignment.evaluated.tolist() == ([] if is_excused else [0])
    assert assignment.on_parked.tolist() == ([] if is_excused else [0])


def test_an_object_just_outside_excuses_its_track_inside():
    scene, tracks = scene_of(boxes_at((30.2, 0))), tracks_of(boxes_at((29.8, 0)))
    assert assign_tracks(scene, tracks, CONFIG).ignored.tolist() == [0]


def test_a_track_inside_of_a_true_object_outside_is_kept():
    scene, tracks = scene_of(boxes_at((29.8, 0))), tracks_of(boxes_at((30.2, 0)))
    assert assign_tracks(scene, tracks, CONFIG).matched_tracks.tolist() == [0]


def test_tracks_outside_the_labelled_view_leave():
    # Ahead, beside the view, behind, and beyond the area.
    tracks = tracks_of(boxes_at((10, 0), (5, 8), (-6, 0), (35, 0)))
    nobody = scene_of(Boxes3D.empty(), view=view_of())
    assert assign_tracks(nobody, tracks, CONFIG).evaluated.tolist() == [0]
    all_around = scene_of(Boxes3D.empty())
    assert assign_tracks(all_around, tracks, CONFIG).evaluated.tolist() == [0, 1, 2]


def test_tracks_in_a_dont_care_region_leave():
    tracks = tracks_of(boxes_at((10, 0)))
    # The box spans about 37 to 63 px from left to right, 47 to 56 px from top to bottom.
    around, half_a_side, elsewhere = (30, 40, 70, 65), (30, 40, 45, 65), (0, 0, 20, 20)
    for regions, evaluated in (
        ([around], []),
        ([half_a_side], [0]),
        ([elsewhere], [0]),
        ([elsewhere, around], []),
    ):
        scene = scene_of(Boxes3D.empty(), view=view_of(*regions))
        assert assign_tracks(scene, tracks, CONFIG).evaluated.tolist() == evaluated
    tracked = scene_of(boxes_at((10, 0)), view=view_of(around))
    assert assign_tracks(tracked, tracks, CONFIG).matched_tracks.tolist() == [0]


def test_a_track_that_fits_an_ignored_neighbour_better_finds_nobody():
    person_m = (0.6, 0.6, 1.7)
    scene = scene_of(boxes_at((10, 0), (10, 1.2), size_m=person_m))
    scene = replace(scene, points=np.array([100, 5]))
    assignment = assign_tracks(scene, tracks_of(boxes_at((10, 1.1), size_m=person_m)), CONFIG)
    assert assignment.targets.tolist() == [0]
    assert assignment.ignored.tolist() == [0]
    assert len(assignment.matched_tracks) == len(assignment.evaluated) == 0
    nearer = assign_tracks(scene, tracks_of(boxes_at((10, 0.3), size_m=person_m)), CONFIG)
    assert nearer.matched_objects.tolist() == [0]


def test_a_part_of_an_ignored_truck_is_excused_and_a_double_of_a_true_car_is_not():
    truck = scene_of(boxes_at((10, 0), size_m=(12.0, 2.5, 3.0)), points=3)
    part = tracks_of(boxes_at((14.5, 0), size_m=(2.0, 2.0, 1.5)))
    assert assign_tracks(truck, part, CONFIG).ignored.tolist() == [0]
    double = tracks_of(boxes_at((10, 0), (10.5, 0)))
    assignment = assign_tracks(scene_of(boxes_at((10, 0))), double, CONFIG)
    assert assignment.matched_tracks.tolist() == [0]
    assert assignment.evaluated.tolist() == [0, 1]


def test_pairs_have_the_greatest_sum_and_are_alike():
    scene = scene_of(boxes_at((10, 0), (10, 3)))
    tracks = tracks_of(boxes_at((10, 2.9), (10, 0.8), (20, 0)))
    assignment = assign_tracks(scene, tracks, CONFIG)
    assert assignment.matched_objects.tolist() == [0, 1]
    assert assignment.matched_tracks.tolist() == [1, 0]
    assert assignment.evaluated.tolist() == [0, 1, 2]


def test_an_exchanged_identity_counts_once():
    frames = [
        (scene, replace(tracks, ids=np.array([3, 8 if n < 6 else 9])))
        for n, (scene, tracks) in enumerate(driving(12))
    ]
    scores = scores_of(frames)
    assert (scores.clear.id_switches, scores.clear.fragmentations) == (1, 0)
    assert scores.hota.det_a.mean() == 1.0
    assert scores.hota.ass_a.mean() == pytest.approx(0.75)
    car, person = errors_over(frames).by_object().values()
    assert (np.unique(car.track_ids).tolist(), car.of_object("Car").switches) == ([3], 0)
    assert np.unique(person.track_ids).tolist() == [8, 9]
    assert person.of_object("Pedestrian").switches == 1


def test_errors_of_place_velocity_heading_and_extent():
    scene = scene_of(boxes_at((10, 0), yaw_rad=3.0))
    boxes = boxes_at((10.3, 0.4), size_m=(3.0, 2.2, 1.5), yaw_rad=-3.0)
    tracks = tracks_of(boxes, velocity_m_s=(5.0, 2.0))
    rows = target_errors(0.0, scene, tracks, assign_tracks(scene, tracks, CONFIG))
    assert rows.center_errors_m[0] == pytest.approx(0.5)
    assert rows.velocity_errors_m_s[0] == pytest.approx(2.0)
    assert rows.heading_errors_rad[0] == pytest.approx(2 * np.pi - 6)
    assert (rows.length_errors_m[0], rows.width_errors_m[0]) == pytest.approx((-1.0, 0.2))
    slow = target_errors(
        0.0,
        scene,
        replace(tracks, velocities_m_s=np.array([[0.5, 0]])),
        assign_tracks(scene, tracks, CONFIG),
    )
    assert np.isnan(slow.summary().heading_rad)
    values = TargetErrors.concatenate([rows, rows, slow]).summary()
    assert (values.velocity_m_s, values.mean_velocity_m_s) == pytest.approx((2.0, 8.5 / 3))
    assert (values.heading_rad, values.width_m) == pytest.approx((2 * np.pi - 6, 0.2))
    assert np.isnan([values.center_coverage, values.velocity_coverage]).all()
    certain = np.tile(np.diag([1.0, 1.0, 1.0, 1.0]), (1, 1, 1))
    known = replace(tracks, covariances=certain)
    spread = target_errors(0.0, scene, known, assign_tracks(scene, known, CONFIG))
    assert (spread.center_spread[0], spread.velocity_spread[0]) == pytest.approx((0.25, 4.0))
    share = spread.of_object("Car")
    assert (share.length_m, share.speed_m_s, share.tracked_percent) == (4.0, 5.0, 100.0)
    assert (share.center_m, share.velocity_m_s) == pytest.approx((0.5, 2.0))
    assert slow.summary().length_m == pytest.approx(1.0)


def test_an_object_that_nobody_follows_is_lost():
    frames = [(scene, Tracks.empty()) for scene, _ in driving(3)]
    rows = errors_over(frames)
    assert (rows.track_ids == NO_TRACK).all()
    assert len(rows.by_object()) == 2
    objects = [one.of_object("Car") for one in rows.by_object().values()]
    assert all(np.isnan(one.time_to_first_track_s) for one in objects)
    assert len(rows.matched) == 0


def test_false_tracks_match_no_object_in_more_than_half_of_their_frames():
    car, ghost, parked = boxes_at((10, 0)), (20.0, 5.0), (15.0, -5.0)
    boxes = boxes_at((10, 0), ghost, parked)
    objects = boxes_at((10, 0), parked)
    scene = replace(
        scene_of(objects),
        objects=LabelledObjects(
            objects, np.array([MotionState.MOVING, MotionState.STATIC]), np.array([1, 2])
        ),
        moves_in_drive=np.array([True, False]),
    )
    here = tracks_of(boxes, [4, 5, 6])
    lucky = tracks_of(car, [5])  # for one frame the ghost is where the car is
    seen = [
        track_outcomes(tracks, assign_tracks(scene, tracks, CONFIG))
        for tracks in (here, here, here, lucky)
    ]
    false = find_false_tracks(TrackOutcomes.concatenate(seen), duration_s=30.0)
    assert false.ids.tolist() == [5, 6]
    assert false.never_matched.tolist() == [6]
    assert false.on_parked.tolist() == [6]
    assert false.per_minute == 4.0


def test_no_tracks_are_no_false_ones():
    false = find_false_tracks(TrackOutcomes.concatenate([]), duration_s=0.0)
    assert len(false.ids) == len(false.never_matched) == len(false.on_parked) == 0
    assert np.isnan(false.per_minute)


def test_points_near_the_feet_do_not_count():
    heights_m = np.array([-1.1, -0.95, -0.75, 0.0, 0.45, 0.6])
    points = np.column_stack([np.full(6, 10.0), np.zeros(6), heights_m, np.zeros(6)])
    assert points_above_bottom(boxes_at((10, 0)), points.astype(np.float32), 0.2).tolist() == [3]


def test_what_cannot_be_is_refused():
    with pytest.raises(UsageError):
        MovingObjectConfig(min_points=0)
    with pytest.raises(UsageError):
        MovingObjectConfig(min_similarity=0.0)
    ends = MovingObjectConfig(min_points=1, min_similarity=1.0)
    assert (ends.min_points, ends.min_similarity) == (1, 1.0)
    with fault(PerceptionError, where="MovingScene.points", found="shape (2,)"):
        replace(scene_of(boxes_at((1, 1))), points=np.zeros(2, np.int64))
