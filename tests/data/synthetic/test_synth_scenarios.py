"""Scripted scenes: what they promise to happen does, to the object that is followed and to nobody else."""

import numpy as np
import pytest

from data.synthetic.scenarios import (
    TARGET_ID,
    Scenario,
    ScenarioChallenge,
    ScenarioDrive,
    all_scenarios,
)
from perception.errors import UsageError
from perception.geometry.boxes import points_inside
from perception.sensor import VLP_16
from perception.types import Boxes3D
from tests.faults import fault

FRAMES = 60


def drive_with(*challenges: ScenarioChallenge, kind="Car", **options) -> ScenarioDrive:
    return ScenarioDrive(Scenario(kind, frozenset(challenges)), images=False, **options)


def object_box(drive: ScenarioDrive, index: int) -> Boxes3D:
    labels = drive.labels_around(index)
    return labels.boxes_velo[labels.track_ids == TARGET_ID]


def points_on_object(drive: ScenarioDrive, index: int) -> int:
    instances = drive.point_truth(index).instances
    return int(np.count_nonzero(instances == TARGET_ID + 1))


def world_positions(drive: ScenarioDrive) -> np.ndarray:
    frames = range(len(drive))
    return np.array(
        [
            drive.true_world_SE3_velo(i)[:3, :3] @ object_box(drive, i).bottom_m[0]
            + drive.true_world_SE3_velo(i)[:3, 3]
            for i in frames
        ]
    )


def test_scenarios_are_none_each_challenge_alone_and_all_together():
    names = [scenario.name for scenario in all_scenarios("Car")]
    assert names == ["baseline", *ScenarioChallenge, "together"]


@pytest.fixture(scope="module")
def baseline() -> ScenarioDrive:
    return drive_with()


def test_in_the_baseline_scene_the_object_drives_evenly_ahead(baseline):
    assert len(baseline) == FRAMES
    speeds_m_s = 10 * np.linalg.norm(np.diff(world_positions(baseline), axis=0), axis=1)
    np.testing.assert_allclose(speeds_m_s, 6.0, atol=0.1)
    for index in (0, FRAMES - 1):
        box = object_box(baseline, index)
        np.testing.assert_allclose(box.bottom_m[0, :2], (18, -6), atol=0.3)
        assert abs(box.yaw_rad[0]) < 0.01


def test_points_lie_in_the_true_box(baseline):
    scan = baseline.scan(7)
    own = scan.points_velo[scan.truth.instances == TARGET_ID + 1]
    assert len(own) > 100
    inside = points_inside(object_box(baseline, 7), own, margin_m=0.15)[0]
    # Mirrors stand out of the box, as they do of KITTI's; a turn of the head smears what moves.
    assert inside.mean() > 0.95


def test_the_same_seed_gives_the_same_drive(baseline):
    again = drive_with()
    np.testing.assert_array_equal(again.scan(3).points_velo, baseline.scan(3).points_velo)


def test_the_object_turns_away_and_back():
    drive = drive_with(ScenarioChallenge.POSE)
    yaw_deg = np.degrees([object_box(drive, i).yaw_rad[0] for i in range(FRAMES)])
    assert yaw_deg.min() == pytest.approx(-65, abs=2)
    assert abs(yaw_deg[0]) < 1
    assert abs(yaw_deg[-1]) < 1
    assert np.abs(np.diff(yaw_deg)).max() < 15


def test_the_distance_shrinks_from_far_to_near():
    drive = drive_with(ScenarioChallenge.DISTANCE)
    ahead_m = np.array([object_box(drive, i).bottom_m[0, 0] for i in range(FRAMES)])
    assert ahead_m[0] == pytest.approx(40, abs=1)
    assert ahead_m[-1] == pytest.approx(18, abs=1)
    assert (np.diff(ahead_m) < 0.1).all()


def test_the_object_brakes_to_a_crawl_and_speeds_up():
    positions = world_positions(drive_with(ScenarioChallenge.VELOCITY))
    speeds_m_s = 10 * np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert speeds_m_s[0] == pytest.approx(6.0, abs=0.2)
    assert speeds_m_s.min() == pytest.approx(0.6, abs=0.1)
    assert speeds_m_s[-1] == pytest.approx(7.8, abs=0.2)


def test_the_light_falls_and_then_exceeds_what_it_was():
    drive = ScenarioDrive(Scenario("Car", frozenset([ScenarioChallenge.ILLUMINATION])))
    before, shade, sun = (float(drive.image(i).mean()) for i in (0, 25, FRAMES - 1))
    assert shade < 0.6 * before
    assert sun > 1.05 * before


@pytest.mark.parametrize("kind", ["Car", "Cyclist", "Pedestrian"])
def test_together_the_van_hides_the_object_and_nobody_runs_into_anybody(kind):
    drive = drive_with(*ScenarioChallenge, kind=kind)
    first, hidden, last = (points_on_object(drive, i) for i in (0, 21, FRAMES - 1))
    assert first > 10
    assert hidden == 0
    assert last > 60
    for index in range(0, FRAMES, 6):
        boxes = drive.labels_around(index).boxes_velo
        half_m = np.hypot(*boxes.size_m[:, :2].T) / 2
        apart_m = np.hypot(*(boxes.bottom_m[0, :2] - boxes.bottom_m[1, :2]))
        assert apart_m > boxes.size_m[:, 1].sum() / 2 + 0.3
        assert (np.hypot(*boxes.bottom_m[:, :2].T) > half_m).all()
        # In view of the camera, whose half angle is 40 degrees.
        assert abs(np.arctan2(boxes.bottom_m[0, 1], boxes.bottom_m[0, 0])) < np.radians(41)


def test_a_short_drive_and_another_sensor():
    drive = ScenarioDrive(Scenario("Cyclist", duration_s=0.5), sensor=VLP_16, images=False)
    assert len(drive) == 5
    assert drive.name == "cyclist baseline"
    assert drive[4].image is None


def test_a_drive_too_short_for_anything_is_refused():
    with fault(UsageError, expected="at least 0.5 s", found="0.1 s"):
        Scenario(duration_s=0.1)
