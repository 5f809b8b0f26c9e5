"""Vehicles over time: one id for each, in gaps, past each other, and together with what moves."""

from dataclasses import replace

import numpy as np
import pytest

from perception.detection.vehicles.locate import locate
from perception.geometry.camera import box_outlines_px
from perception.geometry.se3 import from_euler
from perception.tracking.vehicles.tracker import VehicleTracker, VehicleTrackerResult
from perception.types import Boxes3D, FusedDetections, Tracks
from tests.vehicle_scenes import FlatRoad, cars, detected, frame_of, observed_from, road, sides

_ROAD = road(step_m=1.0)


class Drive:
    """A vehicle that drives ahead at 5 m/s past boxes of the world, seen by a perfect detector."""

    def __init__(self, speed_m_s: float = 5.0) -> None:
        self.tracker = VehicleTracker()
        self.speed_m_s, self.index, self.yaw_rad = speed_m_s, -1, 0.0

    def turn(self, yaw_rad: float) -> None:
        """Turn to the left."""
        self.yaw_rad += yaw_rad

    def observe(
        self,
        world: Boxes3D,
        *,
        scores: float = 0.9,
        types: tuple[str, ...] = (),
        moving: Tracks | None = None,
        missed: tuple[int, ...] = (),
        blind: bool = False,
        returns_of: Boxes3D | None = None,
        boxes_px: np.ndarray | None = None,
    ) -> VehicleTrackerResult:
        """Drive for a tenth of a second, and update the tracker.

        Args:
            world: Vehicles in the world.
            scores: Scores of all detections.
            types: Classes of all vehicles; else all are cars.
            moving: Moving objects in the frame of the scan, with the ids of their own tracker.
            missed: Rows that are not detected.
            blind: Whether the LiDAR observes the road only.
            returns_of: Objects in the world that the LiDAR observes; else the vehicles.
            boxes_px: Detected boxes in the image; else those of a perfect detector.
        """
        self.index += 1
        x_m = 0.1 * self.speed_m_s * self.index
        pose, boxes = observed_from(x_m, world, self.yaw_rad)
        bodies = boxes if returns_of is None else observed_from(x_m, returns_of, self.yaw_rad)[1]
        body = np.zeros((0, 3)) if blind else sides(bodies)
        frame = frame_of(_ROAD, body, index=self.index)
        found = np.setdiff1d(np.arange(len(world)), missed)
        shown = detected(boxes, scores)
        if boxes_px is not None:
            shown = replace(shown, detections=replace(shown.detections, boxes_px=boxes_px))
        if types:
            shown = replace(shown, detections=replace(shown.detections, types=np.array(types)))
        located = locate(shown[found], frame, FlatRoad())
        return self.tracker.update(located, frame, pose, moving)


def driven(world: Boxes3D, along_m: float) -> Boxes3D:
    """Return boxes so far ahead."""
    return replace(world, bottom_m=world.bottom_m + np.array([along_m, 0, 0]))


def moving_at(boxes: Boxes3D, *numbers: int) -> Tracks:
    """Return moving objects at the places of boxes."""
    count = len(numbers)
    return Tracks.unclassified(np.array(numbers), boxes, np.ones((count, 2)), np.ones(count, bool))


def test_parked_cars_keep_their_ids_and_stand_still():
    drive, world = Drive(), cars((20.0, 4.0, 0.0), (28.0, -4.0, 0.0), (36.0, 4.0, 0.0))
    reported = [drive.observe(world).vehicles for _ in range(20)]
    assert [one.ids.tolist() for one in reported] == [[0, 1, 2]] * 20
    np.testing.assert_allclose(reported[-1].velocities_m_s, 0.0, atol=0.3)
    assert np.isnan(reported[0].velocities_m_s).all()


def test_cars_parked_side_by_side_stand_and_keep_their_ids_at_two_scans_a_second():
    drive, row = Drive(speed_m_s=0.0), cars(*[(20.0, 2.8 * place, 0.0) for place in range(-1, 2)])
    for _ in range(8):
        drive.index += 4
        reported = drive.observe(row).vehicles
    assert reported.ids.tolist() == [0, 1, 2]
    np.testing.assert_allclose(reported.velocities_m_s, 0.0, atol=0.05)


@pytest.mark.parametrize(
    ("turned_deg", "is_stated", "off_m", "number"),
    [(2, False, 1.56, 1), (2, True, 0.05, 0), (3, True, 0.03, 0), (8, True, 0.02, 0)],
)
def test_a_scan_of_doubtful_pose_hardly_moves_a_vehicle(turned_deg, is_stated, off_m, number):
    """One scan turned by two degrees shifts a car 45 m away by 1.6 m, and by its width in the image."""
    tracker, turned, world = VehicleTracker(), np.radians(turned_deg), cars((45.0, 2.0, 0.0))
    found = []
    for step in range(20):
        pose = from_euler(0, 0, turned if step == 15 else 0.0)
        stated = np.diag([0, 0, 0, 0, 0, turned**2]) if is_stated and step == 15 else None
        frame = frame_of(_ROAD, sides(world), index=step)
        located = locate(detected(world), frame, FlatRoad())
        vehicles = tracker.update(located, frame, pose, covariance=stated).vehicles
        place_m = pose[:3, :3] @ vehicles.boxes.bottom_m[0]
        found.append((place_m[1] - 2.0, *vehicles.ids.tolist()))
        # The box in the image is where the car is seen, however the pose is.
        if is_stated:
            box_px = vehicles.fused.detections.boxes_px[0]
            np.testing.assert_allclose(box_px, detected(world).detections.boxes_px[0], atol=2)
    off, ids = np.array(found[15:]).T
    assert np.abs(off).max() == pytest.approx(off_m, abs=0.01)
    assert ids.tolist() == [number, 0, 0, 0, 0]


def test_a_less_sure_detection_is_confirmed_by_the_next_one():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    reported = [drive.observe(world, scores=0.75).vehicles.ids.tolist() for _ in range(3)]
    assert reported == [[-1], [0], [0]]


def test_a_moving_car_has_its_speed_and_its_course():
    drive, world = Drive(), cars((42.0, 3.0, 0.0))
    for step in range(20):
        reported = drive.observe(driven(world, -0.8 * step)).vehicles
    np.testing.assert_allclose(reported.velocities_m_s, [[-8.0, 0.0]], atol=0.5)
    assert np.cos(reported.boxes.yaw_rad[0]) < -0.99


def test_who_walks_across_the_road_faces_across_it():
    drive = Drive(speed_m_s=0.0)
    for step in range(25):
        walker = cars((15.0, 4.0 - 0.14 * step, 0.0), size_m=(0.8, 0.6, 1.7))
        reported = drive.observe(walker, types=("Pedestrian",)).vehicles
    assert reported.ids.tolist() == [0]
    assert abs(reported.boxes.yaw_rad[0] + np.pi / 2) < 0.3


@pytest.mark.parametrize(("speed_m_s", "expected"), [(1.4, "Pedestrian"), (6.0, "Cyclist")])
def test_a_person_faster_than_a_walker_rides(speed_m_s, expected):
    drive = Drive(speed_m_s=0.0)
    for step in range(20):
        person = cars((12.0 + 0.1 * speed_m_s * step, 3.0, 0.0), size_m=(1.7, 0.6, 1.7))
        reported = drive.observe(person, types=("Pedestrian",)).vehicles
    assert reported.ids.tolist() == [0]
    assert reported.fused.detections.types.tolist() == [expected]


def test_a_walker_first_located_elsewhere_does_not_ride():
    drive = Drive(speed_m_s=0.0)
    walker = cars((14.0, 3.0, 0.0), size_m=(0.8, 0.6, 1.7))
    behind = cars((16.0, 3.4, 0.0), size_m=(0.8, 0.6, 1.7))
    types = []
    for returns_of in [behind] * 2 + [walker] * 20:
        reported = drive.observe(walker, types=("Pedestrian",), returns_of=returns_of).vehicles
        types += reported.fused.detections.types.tolist()
    assert types == ["Pedestrian"] * 22


def test_a_rider_who_waits_rides_on():
    drive = Drive(speed_m_s=0.0)
    for step in range(50):
        person = cars((12.0 + 0.6 * min(step, 25), 3.0, 0.0), size_m=(1.7, 0.6, 1.7))
        reported = drive.observe(person, types=("Pedestrian",)).vehicles
    assert reported.fused.detections.types.tolist() == ["Cyclist"]


def _yaws(drive: Drive, world: Boxes3D, along_m: list[float]) -> np.ndarray:
    """Return the reported heading of one vehicle while it goes along x."""
    reported = [drive.observe(driven(world, x_m)).vehicles for x_m in along_m]
    return np.array([one.boxes.yaw_rad[0] for one in reported])


def test_front_and_rear_stay_where_they_are_while_the_vehicle_stops_and_backs():
    drive, world = Drive(speed_m_s=0.0), cars((30.0, 3.0, 0.0))
    comes = _yaws(drive, world, [-0.8 * step for step in range(15)])
    assert (np.cos(comes[5:]) < -0.99).all()
    waits = _yaws(drive, world, [-11.2] * 20)
    assert (np.cos(waits) < -0.99).all()
    backs = _yaws(drive, world, [-11.2 + 0.3 * step for step in range(6)])
    assert (np.cos(backs) < -0.99).all()


def test_a_parked_truck_faces_as_the_traffic_where_it_was_mostly_seen():
    drive, world = Drive(speed_m_s=0.0), cars((25.0, 6.0, 0.0), size_m=(9.0, 2.5, 3.0))
    drive.turn(0.5)  # so that it is on the right at first
    drive.observe(world, types=("Truck",))
    drive.turn(-0.5)
    for _ in range(4):
        oncoming = drive.observe(world, types=("Truck",)).vehicles
    assert abs(oncoming.boxes.yaw_rad[0]) == pytest.approx(np.pi, abs=0.1)


def test_a_parked_car_whose_box_jumps_along_its_length_faces_as_the_traffic_there():
    drive, world = Drive(speed_m_s=0.0), cars((25.0, -4.0, 0.0))
    for jump_m in (1.5, 1.0, 0.5):  # as a car would come
        drive.observe(world, returns_of=driven(world, jump_m))
    for _ in range(15):
        parked = drive.observe(world).vehicles
    assert parked.boxes.yaw_rad[0] == pytest.approx(0.0, abs=0.1)


def test_what_is_located_elsewhere_has_not_moved_yet():
    drive, world = Drive(speed_m_s=0.0), cars((30.0, -0.5, 0.0))
    comes = _yaws(drive, world, [-0.8 * step for step in range(12)])
    assert np.cos(comes[-1]) < -0.99
    here, behind = driven(world, -8.8), driven(world, -3.0)
    parked = [drive.observe(here, returns_of=behind).vehicles.boxes.yaw_rad[0] for _ in range(30)]
    assert parked[-1] == pytest.approx(0.0, abs=0.1)


def test_a_vehicle_that_goes_on_backwards_has_its_front_there():
    drive, world = Drive(speed_m_s=0.0), cars((15.0, 3.0, 0.0))
    _yaws(drive, world, [-0.3 * step for step in range(8)])
    away = _yaws(drive, world, [-2.1 + 0.8 * step for step in range(40)])
    assert np.cos(away[-1]) > 0.99
    assert (np.abs(np.diff(np.cos(away))) > 1).sum() <= 1


def test_a_detection_with_the_points_of_another_object_does_not_move_its_vehicle():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0))
    for _ in range(5):
        expected = drive.observe(world).vehicles.boxes
    # The same rectangle in the image around a wall across the road, nearer to the LiDAR.
    reported = drive.observe(world, returns_of=cars((12.0, 2.4, np.pi / 2))).vehicles
    np.testing.assert_allclose(reported.boxes.bottom_m, expected.bottom_m, atol=0.1)
    np.testing.assert_allclose(reported.boxes.yaw_rad, expected.yaw_rad, atol=0.05)


def test_a_new_track_does_not_outweigh_the_next_detection():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0))
    drive.observe(world, returns_of=cars((12.0, 2.4, np.pi / 2)))
    reported = drive.observe(world).vehicles
    np.testing.assert_allclose(reported.boxes.bottom_m, world.bottom_m, atol=0.3)


def test_covariances_shrink_and_belong_to_the_axes_of_the_lidar():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    reported = [drive.observe(world).vehicles for _ in range(20)]
    first, last = reported[0].covariances[0], reported[-1].covariances[0]
    assert (np.linalg.eigvalsh(last) > 0).all()
    assert (np.diagonal(last) < np.diagonal(first)).all()
    hidden = drive.observe(cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0)), blind=True).vehicles
    assert np.isfinite(hidden.covariances[0]).all()
    assert np.isnan(hidden.covariances[1]).all()


def test_the_class_of_a_person_has_the_largest_sum_of_evidence():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0), size_m=(0.8, 0.6, 1.75))
    walks, rides = "Pedestrian", "Cyclist"
    reported = []
    for kind in (walks, walks, rides, walks, rides, rides, rides, rides):
        vehicles = drive.observe(world, types=(kind,)).vehicles
        reported.append((vehicles.ids.tolist(), vehicles.fused.detections.types.tolist()))
    assert [ids for ids, _ in reported] == [[0]] * 8
    assert [kind for _, kind in reported] == [[walks]] * 6 + [[rides]] * 2


@pytest.mark.parametrize(("height_m", "expected"), [(1.5, "Car"), (2.1, "Van")])
def test_height_tells_a_van_from_a_car_whatever_its_image(height_m, expected):
    drive = Drive(speed_m_s=0.0)
    world = cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0), size_m=(4.6, 1.8, height_m))
    for _ in range(3):
        vehicles = drive.observe(world, types=("Car", "Van")).vehicles
    assert vehicles.fused.detections.types.tolist() == [expected, expected]


def test_a_tall_vehicle_is_no_person():
    drive = Drive(speed_m_s=0.0)
    world = cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0), size_m=(4.0, 1.65, 1.75))
    for _ in range(3):
        vehicles = drive.observe(world, types=("Car", "Pedestrian")).vehicles
    assert vehicles.fused.detections.types.tolist() == ["Car", "Pedestrian"]


def test_a_person_within_the_box_of_a_vehicle_does_not_continue_its_track():
    drive, world = Drive(speed_m_s=0.0), cars((12.0, 4.0, 0.0))
    for _ in range(4):
        known = drive.observe(world).vehicles
    (x1, y1, x2, y2), *_ = known.fused.detections.boxes_px.tolist()
    person_px = np.array([[x1 + (x2 - x1) / 3, y1, x2 - (x2 - x1) / 3, y2]])
    for _ in range(4):
        inside = drive.observe(world, types=("Pedestrian",), boxes_px=person_px).vehicles
    assert known.ids.tolist() == [0]
    assert inside.ids.tolist() == [1]
    assert inside.fused.detections.types.tolist() == ["Pedestrian"]


def test_without_returns_the_class_is_that_of_the_detections():
    drive, world = Drive(), cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0), size_m=(4.6, 1.8, 2.1))
    for _ in range(3):
        vehicles = drive.observe(world, types=("Car", "Van"), blind=True).vehicles
    assert vehicles.fused.detections.types.tolist() == ["Car", "Van"]


def test_height_tells_no_class_of_what_has_had_no_returns_for_long():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0), size_m=(5.0, 1.9, 2.1))
    for _ in range(5):
        reported = drive.observe(world).vehicles
    assert reported.fused.detections.types.tolist() == ["Van"]
    types = [drive.observe(world, blind=True).vehicles.fused.detections.types[0] for _ in range(60)]
    assert types == ["Van"] * types.count("Van") + ["Car"] * types.count("Car")
    assert 20 <= types.count("Van") <= 40  # the memory is one of four seconds


def test_a_box_that_is_cut_in_the_image_is_completed_by_its_3d_box():
    drive, world = Drive(speed_m_s=0.0), cars((15.0, 5.0, 0.0))
    true_px = detected(observed_from(0.0, world)[1]).detections.boxes_px
    cut_px = true_px - np.array([0, 0, 20, 0])
    for _ in range(4):
        reported_px = drive.observe(world, boxes_px=cut_px).vehicles.fused.detections.boxes_px
    assert cut_px[0, 2] + 5 < reported_px[0, 2] < true_px[0, 2]
    np.testing.assert_allclose(reported_px[0, [0, 1, 3]], true_px[0, [0, 1, 3]], atol=6)


def test_a_side_behind_a_nearer_car_is_where_the_3d_box_ends():
    far, near = (20.0, 2.0, 0.0), (12.0, -0.1, 0.0)
    reported_px = []
    for world in (cars(far), cars(far, near)):
        drive = Drive(speed_m_s=0.0)
        cut_px = detected(observed_from(0.0, world)[1]).detections.boxes_px
        cut_px[0, 2] = 560.0  # where the nearer one begins
        for _ in range(4):
            vehicles = drive.observe(world, boxes_px=cut_px).vehicles
        reported_px.append(vehicles.fused.detections.boxes_px[0])
    alone_px, behind_px = reported_px
    calibration = frame_of(road()).calibration
    outline_px = box_outlines_px(calibration.image_P_velo, vehicles.boxes[:1], (1242, 375))[0]
    assert outline_px[2] > 560 + 4
    assert behind_px[2] == pytest.approx(outline_px[2], abs=0.01)
    assert alone_px[2] < behind_px[2] - 1
    np.testing.assert_allclose(behind_px[[0, 1, 3]], alone_px[[0, 1, 3]], atol=0.5)


def test_a_3d_box_elsewhere_leaves_the_box_in_the_image_alone():
    drive, world = Drive(speed_m_s=0.0), cars((15.0, 5.0, 0.0))
    for _ in range(4):
        shown = drive.observe(world, returns_of=cars((10.0, 4.2, 0.0))).vehicles
    true_px = detected(observed_from(0.0, world)[1]).detections.boxes_px
    np.testing.assert_allclose(shown.fused.detections.boxes_px, true_px, atol=0.01)


def test_two_classes_at_one_place_are_one_object():
    drive, world = Drive(), cars((20.0, 4.0, 0.0), (20.0, 4.0, 0.0))
    for _ in range(4):
        ids = drive.observe(world, types=("Car", "Van")).vehicles.ids.tolist()
    assert ids == [0, -1]


def test_a_box_without_returns_within_another_is_no_second_object():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0), (26.0, 5.0, 0.0))
    for _ in range(4):
        ids = drive.observe(world, returns_of=world[[0]]).vehicles.ids.tolist()
    assert ids == [0, -1]


def test_existence_adds_up_over_frames():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    reported = [drive.observe(world, scores=0.7).vehicles.fused.existence[0] for _ in range(6)]
    assert (np.diff(reported) > 0).all()
    assert reported[-1] > 0.9
    doubtful = drive.observe(world, scores=0.2).vehicles
    assert doubtful.ids.tolist() == [0]
    assert doubtful.fused.existence[0] > 0.7


@pytest.mark.parametrize(("name", "expected"), [("Pedestrian", 0.9), ("Car", 0.01)])
def test_a_weak_detection_speaks_for_a_person_who_is_expected(name, expected):
    size_m = (0.8, 0.6, 1.75) if name == "Pedestrian" else (4.0, 1.65, 1.5)
    drive, world = Drive(speed_m_s=0.0), cars((15.0, 2.0, 0.0), size_m=size_m)
    for step in range(20):
        found = drive.observe(world, scores=0.9 if step < 5 else 0.25, types=(name,)).vehicles
    assert found.ids.tolist() == [0]
    assert found.fused.existence == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("blind", [False, True])
def test_a_parked_car_is_found_again_after_a_turn(blind):
    drive, world = Drive(), cars((35.0, 4.0, 0.0), (45.0, -4.0, 0.0))
    for _ in range(6):
        ids = drive.observe(world, blind=blind).vehicles.ids.tolist()
    for _ in range(5):
        drive.turn(0.04)
        drive.observe(world, missed=(0, 1), blind=blind)
    assert drive.observe(world, blind=blind).vehicles.ids.tolist() == ids == [0, 1]


def test_a_car_whose_first_returns_come_late_keeps_its_id():
    drive, world = Drive(), cars((40.0, 4.0, 0.0))
    reported = [drive.observe(world, blind=step < 6).vehicles for step in range(12)]
    assert [one.ids.tolist() for one in reported[1:]] == [[0]] * 11
    assert np.isnan(reported[5].boxes.yaw_rad).all()
    assert np.isfinite(reported[6].boxes.yaw_rad).all()
    np.testing.assert_allclose(reported[-1].velocities_m_s, 0.0, atol=1.0)


def test_a_moving_object_has_the_class_and_the_score_of_its_vehicle():
    drive, world = Drive(speed_m_s=0.0), cars((30.0, -4.0, 0.0), (20.0, 4.0, 0.0))
    moving = moving_at(world, 7, 8)
    for _ in range(4):
        tracks = drive.observe(world, missed=(1,), types=("Van", "Car"), moving=moving).tracks
    assert tracks.types.tolist() == ["Van", ""]
    np.testing.assert_array_equal(tracks.scores, [0.9, np.nan])
    tracks = drive.observe(world, missed=(0, 1), types=("Van", "Car"), moving=moving).tracks
    assert tracks.types.tolist() == ["Van", ""]


@pytest.mark.parametrize("blind", [False, True])
def test_a_gap_is_bridged(blind):
    drive, world = Drive(), cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0))
    for _ in range(5):
        ids = drive.observe(world, blind=blind).vehicles.ids.tolist()
    for _ in range(6):
        drive.observe(world, missed=(0,), blind=blind)
    assert drive.observe(world, blind=blind).vehicles.ids.tolist() == ids == [0, 1]


@pytest.mark.parametrize(("gap", "ids"), [(0, [1]), (10, [0])])
def test_what_was_hidden_for_a_second_is_found_again_beside_its_expected_box(gap, ids):
    drive = Drive(speed_m_s=0.0)
    for _ in range(4):
        drive.observe(cars((22.0, -4.0, 0.0)))
    for _ in range(gap):
        drive.observe(cars((22.0, -4.0, 0.0)), missed=(0,), blind=True)
    found = drive.observe(cars((22.0, -2.4, 0.0))).vehicles
    assert found.ids.tolist() == ids


def test_two_tracks_that_come_to_one_place_are_the_older_one():
    drive, ids = Drive(speed_m_s=0.0), []
    for left_m in (-4.0, -4.0, -4.0, -2.4, -2.8, -3.1, -3.2, -3.3, -3.4, -3.4):
        ids += drive.observe(cars((22.0, left_m, 0.0))).vehicles.ids.tolist()
    assert ids == [0, 0, 0, 1, 1, 1, 1, 1, 0, 0]


def test_in_a_row_no_car_takes_the_id_of_a_missed_neighbour():
    drive, world = (
        Drive(speed_m_s=8.0),
        cars(*[(14.0 + 5.5 * place, 4.0, 0.0) for place in range(6)]),
    )
    for _ in range(4):
        expected = drive.observe(world).vehicles.ids.tolist()
    assert expected == list(range(6))
    for missed in (1, 3, 2, 4, 0, 3):
        reported = drive.observe(world, missed=(missed,)).vehicles.ids.tolist()
        assert reported == [one for one in expected if one != missed]
    assert drive.observe(world).vehicles.ids.tolist() == expected


def test_a_vehicle_that_is_not_located_is_tracked_in_the_image():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    for _ in range(3):
        drive.observe(world)
    reported = [drive.observe(world, blind=True).vehicles for _ in range(4)]
    assert [one.ids.tolist() for one in reported] == [[0]] * 4
    assert np.isnan(reported[0].boxes.yaw_rad).all()


def test_a_vehicle_that_was_away_for_long_is_new():
    drive, world = Drive(speed_m_s=0.0), cars((20.0, 4.0, 0.0))
    for _ in range(3):
        drive.observe(world)
    for _ in range(20):
        drive.observe(world, missed=(0,))
    drive.observe(world)
    assert drive.observe(world).vehicles.ids.tolist() == [1]


def test_without_returns_vehicles_are_tracked_in_the_image():
    drive, world = Drive(), cars((30.0, 4.0, 0.0), (34.0, -4.0, 0.0))
    reported = [drive.observe(world, blind=True).vehicles for _ in range(10)]
    assert [one.ids.tolist() for one in reported[1:]] == [[0, 1]] * 9
    assert np.isnan(reported[-1].boxes.bottom_m).all()
    assert np.isnan(reported[-1].velocities_m_s).all()


def test_detections_of_low_scores_begin_no_track():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    assert [drive.observe(world, scores=0.2).vehicles.ids.tolist() for _ in range(8)] == [[-1]] * 8


def test_detections_of_low_scores_continue_a_track():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    for _ in range(3):
        drive.observe(world)
    assert [drive.observe(world, scores=0.2).vehicles.ids.tolist() for _ in range(5)] == [[0]] * 5


def test_detections_of_the_lowest_scores_continue_no_track():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    for _ in range(3):
        drive.observe(world)
    assert drive.observe(world, scores=0.15).vehicles.ids.tolist() == [-1]


def test_a_car_that_leaves_the_image_has_its_box_within():
    drive, world = Drive(speed_m_s=20.0), cars((20.0, 5.0, 0.0))
    left_px = [drive.observe(world).vehicles.fused.detections.boxes_px[0, 0] for _ in range(8)]
    assert left_px[0] > 300.0
    assert left_px[-2:] == [0.0, 0.0]


def test_a_car_that_overtakes_another_keeps_its_id():
    drive, pair = Drive(), cars((15.0, 1.5, 0.0), (30.0, -1.5, 0.0))
    for step in range(30):
        world = replace(pair, bottom_m=pair.bottom_m + step * np.array([[1.2, 0, 0], [0.3, 0, 0]]))
        ids = drive.observe(world).vehicles.ids.tolist()
    assert ids == [0, 1]


def test_a_frame_without_detections_is_no_fault():
    drive = Drive()
    reported = drive.observe(Boxes3D.empty())
    assert len(reported.vehicles) == len(reported.tracks) == 0
    assert len(reported.vehicles.fused) == len(FusedDetections.empty())


def test_time_that_goes_back_clears_the_tracks():
    drive, world = Drive(), cars((20.0, 4.0, 0.0))
    for _ in range(3):
        drive.observe(world)
    drive.index = -1
    drive.observe(world)
    assert drive.observe(world).vehicles.ids.tolist() == [1]


def in_scan(drive: Drive, world: Boxes3D) -> Boxes3D:
    """Return boxes as the next scan will have them."""
    return observed_from(0.5 * (drive.index + 1), world)[1]


def test_a_vehicle_that_begins_to_move_keeps_its_id():
    drive, world = Drive(), cars((20.0, 4.0, 0.0), (30.0, -4.0, 0.0))
    for _ in range(4):
        drive.observe(world)
    reported = [
        drive.observe(world, moving=moving_at(in_scan(drive, world)[[1]], 7)) for _ in range(4)
    ]
    assert [one.tracks.ids.tolist() for one in reported] == [[1]] * 4
    assert [one.vehicles.ids.tolist() for one in reported] == [[0, 1]] * 4


def test_a_vehicle_takes_the_id_of_what_moved_there_before():
    drive, world = Drive(), cars((30.0, -4.0, 0.0))
    for _ in range(4):
        reported = drive.observe(world, missed=(0,), moving=moving_at(in_scan(drive, world), 7))
        assert reported.tracks.ids.tolist() == [0]
    reported = [drive.observe(world, moving=moving_at(in_scan(drive, world), 7)) for _ in range(4)]
    assert [one.vehicles.ids.tolist() for one in reported] == [[0]] * 4
    assert [one.tracks.ids.tolist() for one in reported] == [[0]] * 4


def test_two_that_turn_out_to_be_one_agree_on_the_id_of_the_vehicle_once():
    drive, world = Drive(), cars((30.0, -4.0, 0.0))
    for _ in range(3):
        beside = cars((30.0, 1.0, 0.0))
        drive.observe(world, moving=moving_at(in_scan(drive, beside), 7))
    reported = [drive.observe(world, moving=moving_at(in_scan(drive, world), 7)) for _ in range(6)]
    ids = [one.tracks.ids.tolist()[0] for one in reported]
    vehicle = reported[0].vehicles.ids.tolist()[0]
    assert [one.vehicles.ids.tolist() for one in reported] == [[vehicle]] * 6
    assert ids[:2] == [ids[0]] * 2 != [vehicle] * 2
    assert ids[2:] == [vehicle] * 4


def test_they_stay_one_when_they_are_apart_for_a_scan_and_are_two_after_some():
    drive, world, away = Drive(), cars((30.0, -4.0, 0.0)), cars((30.0, 6.0, 0.0))
    for _ in range(4):
        drive.observe(world, moving=moving_at(in_scan(drive, world), 7))
    reported = [
        drive.observe(world, moving=moving_at(in_scan(drive, place), 7)).tracks.ids.tolist()[0]
        for place in (away, world, away, away, away, away)
    ]
    vehicle = drive.observe(world).vehicles.ids.tolist()[0]
    assert reported[:4] == [vehicle] * 4
    assert reported[4] == reported[5] != vehicle


def test_a_lost_vehicle_leaves_its_id_to_what_moves_and_gets_it_back():
    drive, world = Drive(speed_m_s=0.0), cars((30.0, -4.0, 0.0))
    for _ in range(4):
        drive.observe(world, moving=moving_at(world, 7))
    for _ in range(25):
        reported = drive.observe(world, missed=(0,), moving=moving_at(world, 7))
    assert reported.tracks.ids.tolist() == [0]
    reported = [drive.observe(world, moving=moving_at(world, 7)) for _ in range(3)]
    assert reported[-1].vehicles.ids.tolist() == reported[-1].tracks.ids.tolist() == [0]


def test_no_id_is_there_twice_whatever_comes():
    rng, drive = np.random.default_rng(3), Drive(speed_m_s=0.0)
    world = cars(*[(12.0 + 5 * row, 4.0 * side, 0.0) for row in range(5) for side in (-1, 1)])
    numbers = np.arange(10)
    for step in range(60):
        missed = tuple(np.flatnonzero(rng.random(10) < 0.4).tolist())
        if step % 10 == 9:
            numbers = numbers + 10  # its tracker restarts
        shown = np.flatnonzero(rng.random(10) < 0.6)
        jitter = world.bottom_m[shown] + rng.normal(0, 1.0, (len(shown), 3))
        boxes = replace(world[shown], bottom_m=jitter)
        reported = drive.observe(
            world, missed=missed, moving=moving_at(boxes, *numbers[shown].tolist())
        )
        ids = reported.vehicles.ids[reported.vehicles.ids >= 0]
        assert len(set(ids.tolist())) == len(ids)
        assert (np.diff(reported.tracks.ids) > 0).all()


def observed_at(rate_hz: float, duration_s: float, world_at, hidden_s=(0.0, 0.0)):
    """Return stamps and vehicles of frames that come up to a tenth of the period early or late."""
    drive = Drive()
    jitter = np.random.default_rng(1).uniform(-0.1, 0.1, round(duration_s * rate_hz))
    stamps_s = (np.arange(len(jitter)) + 0.1 + jitter) / rate_hz
    reported = []
    for stamp_s in stamps_s.tolist():
        drive.index = 10 * stamp_s - 1
        is_hidden = hidden_s[0] <= stamp_s < hidden_s[1]
        world = world_at(stamp_s)
        missed = tuple(range(len(world))) if is_hidden else ()
        reported.append(drive.observe(world, missed=missed, blind=is_hidden).vehicles)
    return stamps_s, reported


RATES = pytest.mark.parametrize("rate_hz", [2, 5, 10, 20])


@RATES
def test_a_car_has_one_id_at_any_rate(rate_hz):
    stamps_s, reported = observed_at(rate_hz, 4.0, lambda t: cars((55.0 - 6.0 * t, 3.0, 0.0)))
    late = [one for stamp_s, one in zip(stamps_s, reported, strict=True) if stamp_s > 1.2]
    assert [one.ids.tolist() for one in late] == [[0]] * len(late)
    np.testing.assert_allclose(late[-1].velocities_m_s, [[-6.0, 0.0]], atol=0.7)


@RATES
def test_two_that_pass_each_other_keep_their_ids_at_any_rate(rate_hz):
    def world_at(stamp_s):
        return cars((12.0 + 8.0 * stamp_s, -3.0, 0.0), (50.0 - 6.0 * stamp_s, 3.0, np.pi))

    stamps_s, reported = observed_at(rate_hz, 3.5, world_at)
    late = [one for stamp_s, one in zip(stamps_s, reported, strict=True) if stamp_s > 1.2]
    assert [one.ids.tolist() for one in late] == [[0, 1]] * len(late)


@RATES
def test_a_second_without_it_keeps_the_id_at_any_rate(rate_hz):
    world_at = lambda stamp_s: cars((16.0 + 7.0 * stamp_s, 3.0, 0.0))  # noqa: E731
    _, reported = observed_at(rate_hz, 4.0, world_at, hidden_s=(1.4, 2.3))
    assert {number for one in reported for number in one.ids.tolist()} <= {-1, 0}
    assert reported[-1].ids.tolist() == [0]


@RATES
def test_who_leaves_and_who_comes_are_two_at_any_rate(rate_hz):
    def world_at(stamp_s):
        return cars((40.0, -4.0, 0.0) if stamp_s < 1.9 else (34.0, 4.0, 0.0))

    _, reported = observed_at(rate_hz, 4.0, world_at)
    assert {number for one in reported for number in one.ids.tolist()} - {-1} == {0, 1}
    assert reported[-1].ids.tolist() == [1]
