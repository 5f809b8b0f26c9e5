from pathlib import Path

import numpy as np
import pytest

from perception.errors import PoseError
from perception.geometry.se3 import from_euler, inverse, orthonormal, rotation_angle_rad
from perception.localization.alignment import (
    align,
    on_surfaces,
    preprocess_points,
    share_on_surfaces,
)
from perception.localization.located_scan import PoseOrigin
from perception.localization.odometry import LidarOdometry

STEP_S = 0.1


def street(seed: int = 0) -> np.ndarray:
    """Sample points of a road, two walls, a cross wall and some poles, in the world's frame."""
    random = np.random.default_rng(seed)

    def sheet(low: tuple, high: tuple, count: int) -> np.ndarray:
        return random.uniform(low, high, (count, 3))

    parts = [
        sheet((-30, -12, -1.7), (60, 12, -1.7), 9000),
        sheet((-30, 12, -1.7), (60, 12, 4), 5000),
        sheet((-30, -12, -1.7), (20, -12, 4), 3000),
        sheet((20, -25, -1.7), (20, -12, 4), 1500),
        sheet((60, -12, -1.7), (60, 12, 4), 1500),
        *(sheet((x, y, -1.7), (x + 0.3, y + 0.3, 3), 60) for x, y in [(5, 8), (15, -9), (33, 7)]),
    ]
    points = np.concatenate(parts)
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


def observed_from(world_SE3_velo: np.ndarray, seed: int) -> np.ndarray:
    """Return another sampling of the street, with 1 cm of noise, in the LiDAR's frame."""
    points = street(seed)
    points[:, :3] += np.random.default_rng(seed + 99).normal(0, 0.01, (len(points), 3))
    moved = points.copy()
    velo_SE3_world = inverse(world_SE3_velo)
    moved[:, :3] = points[:, :3] @ velo_SE3_world[:3, :3].T + velo_SE3_world[:3, 3]
    return moved[np.hypot(moved[:, 0], moved[:, 1]) < 50]


def path(frames: int, speed_m_s: float = 8.0, turn_rad_s: float = 0.15) -> list[np.ndarray]:
    step = from_euler(0, 0, turn_rad_s * STEP_S, np.array([speed_m_s * STEP_S, 0, 0]))
    poses = [np.eye(4)]
    for _ in range(frames - 1):
        poses.append(poses[-1] @ step)
    return poses


def apart(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Return metres and degrees between two poses."""
    between = inverse(first) @ second
    return float(np.linalg.norm(between[:3, 3])), np.degrees(rotation_angle_rad(between))


@pytest.mark.parametrize("kind", ["GICP", "ICP"])
def test_alignment_recovers_a_known_transform(kind: str) -> None:
    truth = from_euler(0.005, -0.01, 0.03, np.array([0.25, -0.1, 0.04]))
    points = observed_from(np.eye(4), 1)
    source = preprocess_points(points, voxel_size_m=0.3)
    # Point to point only finds the truth where it meets the same points again.
    target_points = points if kind == "ICP" else observed_from(np.eye(4), 2)
    moved = target_points.copy()
    moved[:, :3] = target_points[:, :3] @ truth[:3, :3].T + truth[:3, 3]
    found = align(
        preprocess_points(moved, voxel_size_m=0.3),
        source,
        np.eye(4),
        max_correspondence_m=1.0,
        kind=kind,
    )
    metres, degrees = apart(truth, found.target_SE3_source)
    assert found.is_converged
    assert 0.5 < found.inlier_ratio <= 1
    assert metres < (0.01 if kind == "GICP" else 0.05)
    assert degrees < (0.05 if kind == "GICP" else 0.3)


def corridor_around(seed: int) -> np.ndarray:
    """Return points of a road between two even walls, which do not tell how far along it the LiDAR is."""
    random = np.random.default_rng(seed)
    parts = [
        random.uniform(low, high, (count, 3))
        for low, high, count in [
            ((-30, -6, -1.7), (30, 6, -1.7), 6000),
            ((-30, 6, -1.7), (30, 6, 3), 4000),
            ((-30, -6, -1.7), (30, -6, 3), 4000),
        ]
    ]
    points = np.concatenate(parts)
    points += random.normal(0, 0.01, points.shape)
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


def test_what_points_do_not_determine_stays_at_the_guess() -> None:
    target, source = (preprocess_points(corridor_around(seed), 0.5) for seed in (1, 2))
    guess = from_euler(0, 0, 0.01, np.array([0.2, 0.1, 0.05]))
    found = align(target, source, guess, 0.5, prior_share=0.006).target_SE3_source
    np.testing.assert_allclose(found[:3, 3], [0.2, 0, 0], atol=0.02)
    assert rotation_angle_rad(found) < 0.002
    # Without a prior, the pattern of the voxels tells the way along the walls.
    slipped = align(target, source, guess, 0.5).target_SE3_source
    assert abs(slipped[0, 3] - 0.2) > 0.1


def test_what_points_determine_is_not_pulled_to_the_guess() -> None:
    target, source = (preprocess_points(observed_from(np.eye(4), seed), 0.5) for seed in (1, 2))
    guess = from_euler(0, 0, 0.01, np.array([0.2, 0.1, 0.05]))
    free, pulled = (
        align(target, source, guess, 0.5, prior_share=share).target_SE3_source
        for share in (0.0, 0.006)
    )
    metres, degrees = apart(free, pulled)
    assert metres < 0.005
    assert degrees < 0.02


def test_a_drive_between_even_walls_follows_the_ins(monkeypatch: pytest.MonkeyPatch) -> None:
    def farthest_m() -> float:
        random, odometry = np.random.default_rng(0), LidarOdometry()
        found = []
        for index in range(8):
            ins = from_euler(0, 0, 0, np.array([0.72 * index + random.normal(0, 0.01), 0, 0]))
            pose = odometry.update(corridor_around(index), index * STEP_S, ins).world_SE3_velo
            found.append(pose[0, 3])
        return float(np.abs(np.diff(found) - 0.72).max())

    assert farthest_m() < 0.04
    monkeypatch.setattr("perception.localization.motion_search._INS_PRIOR_SHARE", 0.0)
    assert farthest_m() > 0.1


def test_noisy_ins_is_refined_to_a_centimetre() -> None:
    truth = path(8)
    random = np.random.default_rng(5)
    odometry = LidarOdometry()
    for index, pose in enumerate(truth):
        noise = from_euler(*random.normal(0, 0.002, 3), random.normal(0, 0.05, 3))
        ins = pose if index == 0 else pose @ noise
        found = odometry.update(observed_from(pose, index), index * STEP_S, ins)
        metres, degrees = apart(pose, found.world_SE3_velo)
        assert metres < 0.01
        assert degrees < 0.05
    assert found.origin is PoseOrigin.REGISTERED
    assert found.inlier_ratio > 0.8


@pytest.mark.parametrize("speed_m_s", [0.0, 9.0, 27.0])
def test_without_ins_registration_alone_carries_the_pose(speed_m_s: float) -> None:
    truth = path(5, speed_m_s)
    odometry = LidarOdometry()
    for index, pose in enumerate(truth):
        found = odometry.update(observed_from(pose, index), index * STEP_S)
    metres, degrees = apart(truth[-1], found.world_SE3_velo)
    assert metres < 0.02
    assert degrees < 0.05


def lorries_around(seed: int) -> np.ndarray:
    """Return points on four lorries that creep along with the vehicle, in its frame."""
    random = np.random.default_rng(seed + 1000)
    parts = [np.zeros((0, 3))]
    for x, y in [(6.0, 0.0), (-2.0, 3.5), (-14.0, 0.0), (8.0, -4.0)]:
        for side in (-1.2, 1.2):
            parts.append(random.uniform((x, y + side, -1.3), (x + 8, y + side, 2), (900, 3)))
        for end in (0.0, 8.0):
            parts.append(random.uniform((x + end, y - 1.2, -1.3), (x + end, y + 1.2, 2), (500, 3)))
    points = np.concatenate(parts)
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


def test_a_jam_that_creeps_along_does_not_carry_the_pose() -> None:
    truth = path(20, speed_m_s=1.75, turn_rad_s=0.0)
    random, odometry = np.random.default_rng(3), LidarOdometry()
    found, resets = [], []
    for index, pose in enumerate(truth):
        points = np.concatenate([observed_from(pose, index)[::3], lorries_around(index)])
        ins = pose @ from_euler(0, 0, 0, random.normal(0, 0.02, 3))
        found.append(odometry.update(points, index * STEP_S, ins))
        resets += [index] if found[-1].is_reset else []
    step = inverse(found[-10].world_SE3_velo) @ found[-1].world_SE3_velo
    metres, degrees = apart(inverse(truth[-10]) @ truth[-1], step)
    assert metres < 0.05
    assert degrees < 0.1
    assert len(resets) == 2  # the start, and where the jam is told from the street
    assert resets[1] < 10


def buildings_along(world_SE3_velo: np.ndarray, seed: int) -> np.ndarray:
    """Return points on the fronts of porches along the street, in the LiDAR's frame."""
    random = np.random.default_rng(seed + 500)
    parts = [
        random.uniform((x, y, -1.7), (x + 0.02, y + 2, 3), (250, 3))
        for x in range(-40, 80, 5)
        for y in (-10, 8)
    ]
    points = np.column_stack([np.concatenate(parts), np.zeros(250 * 48)])
    points[:, 0] -= world_SE3_velo[0, 3]
    return points[np.abs(points[:, 0]) < 40].astype(np.float32)


@pytest.mark.parametrize("speed_m_s", [1.75, 10.0])
def test_traffic_that_comes_along_does_not_carry_the_pose_without_ins(speed_m_s: float) -> None:
    truth = path(20, speed_m_s, turn_rad_s=0.0)
    odometry, found, resets = LidarOdometry(), [], []
    for index, pose in enumerate(truth):
        static = [observed_from(pose, index)[::2], buildings_along(pose, index)]
        points = np.concatenate([*static, lorries_around(index)])
        found.append(odometry.update(points, index * STEP_S))
        resets += [index] if found[-1].is_reset else []
    step = inverse(found[-10].world_SE3_velo) @ found[-1].world_SE3_velo
    metres, degrees = apart(inverse(truth[-10]) @ truth[-1], step)
    assert metres < 0.05
    assert degrees < 0.1
    assert len(resets) <= 2  # the start, and where the traffic is told from the street
    assert max(resets) < 10


@pytest.mark.parametrize("speed_m_s", [0.0, 8.0])
def test_traffic_that_passes_does_not_carry_the_pose_without_ins(speed_m_s: float) -> None:
    truth = path(12, speed_m_s, turn_rad_s=0.0)
    odometry = LidarOdometry()
    for index, pose in enumerate(truth):
        lorries = lorries_around(index)
        lorries[:, 0] += 20.0 - (speed_m_s + 4.0) * index * STEP_S
        static = [observed_from(pose, index), buildings_along(pose, index)]
        found = odometry.update(np.concatenate([*static, lorries]), index * STEP_S)
        assert found.is_reset == (index == 0)
    metres, degrees = apart(truth[-1], found.world_SE3_velo)
    assert metres < 0.05
    assert degrees < 0.1


def test_points_on_surfaces_are_counted() -> None:
    target = preprocess_points(observed_from(np.eye(4), 1), voxel_size_m=0.5)
    source = preprocess_points(observed_from(np.eye(4), 2), voxel_size_m=0.5)
    away = from_euler(0, 0, 0, np.array([0.0, 0.0, 0.3]))
    assert share_on_surfaces(source, target, np.eye(4), 0.05) > 0.85
    # A street that is raised keeps its walls, but not its ground.
    assert share_on_surfaces(source, target, away, 0.05) < 0.6
    assert len(source.thinned(100)) == pytest.approx(100, rel=0.1)


def test_vehicles_that_move_off_do_not_pull_the_pose() -> None:
    """Lorries that come 30 cm or less between two keyframes match, but not what is static."""
    pose, odometry = np.eye(4), LidarOdometry()
    for index in range(12):
        static, lorries = observed_from(pose, index)[::4], lorries_around(index)
        lorries[:, 0] += 0.06 * index
        points = np.concatenate([static, lorries])
        found = odometry.update(points, index * STEP_S, pose)
        odometry.mark_moving(np.arange(len(points)) >= len(static))
        metres, degrees = apart(pose, found.world_SE3_velo)
        assert metres < 0.05
        assert degrees < 0.1
    assert found.origin is PoseOrigin.REGISTERED


def test_an_ins_that_errs_does_not_carry_the_pose_where_much_moves() -> None:
    truth, random, odometry = path(12, 5.0, 0.0), np.random.default_rng(4), LidarOdometry()
    for index, pose in enumerate(truth):
        static = [observed_from(pose, index)[::2], buildings_along(pose, index)]
        lorries = lorries_around(index)
        lorries[:, 0] += 20.0 - 0.7 * index
        points = np.concatenate([*static, lorries])
        ins = pose @ from_euler(0, 0, 0, np.array([*random.normal(0, 0.4, 2), 0.0]))
        found = odometry.update(points, index * STEP_S, ins if index > 2 else pose)
        odometry.mark_moving(np.arange(len(points)) >= len(points) - len(lorries))
        metres, degrees = apart(pose, found.world_SE3_velo)
        assert metres < 0.05
        assert degrees < 0.1


def test_what_is_off_the_surfaces_takes_no_part() -> None:
    target = preprocess_points(observed_from(np.eye(4), 1), voxel_size_m=0.5)
    beside = np.random.default_rng(0).uniform((2, -3, 0), (8, 3, 1), (400, 3))
    source = np.concatenate([observed_from(np.eye(4), 2)[:, :3], beside])
    kept = on_surfaces(
        preprocess_points(source.astype(np.float32), voxel_size_m=0.5), target, np.eye(4), 0.1
    )
    is_beside = (np.abs(kept.places_m[:, 1]) < 3) & (np.abs(kept.places_m[:, 2] - 0.5) < 0.5)
    assert not is_beside[(kept.places_m[:, 0] > 2) & (kept.places_m[:, 0] < 8)].any()
    assert len(kept) > 0.9 * len(target)


def test_many_keyframes_do_not_skew_the_rotation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each keyframe's pose is built on the one before: any skew would double each time."""
    monkeypatch.setattr("perception.localization.keyframes._KEYFRAME_M", 0.0)
    monkeypatch.setattr("perception.localization.keyframes.MIN_KEYFRAME_M", 0.0)
    odometry = LidarOdometry()
    points = observed_from(np.eye(4), 0)
    for index in range(40):
        found = odometry.update(points, index * STEP_S)
    rotation = found.world_SE3_velo[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert found.origin is PoseOrigin.REGISTERED


def test_same_input_gives_the_same_poses() -> None:
    def run() -> list[np.ndarray]:
        odometry = LidarOdometry()
        return [
            odometry.update(observed_from(pose, index), index * STEP_S).world_SE3_velo
            for index, pose in enumerate(path(3))
        ]

    for first, second in zip(run(), run(), strict=True):
        np.testing.assert_array_equal(first, second)


def test_a_scan_that_does_not_match_falls_back_on_the_ins() -> None:
    truth = path(3)
    odometry = LidarOdometry()
    odometry.update(observed_from(truth[0], 0), 0.0, truth[0])
    nonsense = np.random.default_rng(0).uniform(200, 300, (5000, 4)).astype(np.float32)
    found = odometry.update(nonsense, STEP_S, truth[1])
    assert found.origin is PoseOrigin.INS
    np.testing.assert_allclose(found.world_SE3_velo, truth[1], atol=1e-9)


def test_a_scan_that_does_not_match_is_extrapolated_without_ins() -> None:
    truth = path(4)
    odometry = LidarOdometry()
    for index in range(3):
        odometry.update(observed_from(truth[index], index), index * STEP_S)
    found = odometry.update(observed_from(truth[3], 3)[:20], 3 * STEP_S)
    assert found.origin is PoseOrigin.EXTRAPOLATED
    assert apart(truth[3], found.world_SE3_velo)[0] < 0.03


def test_steady_motion_at_speed_is_no_jump() -> None:
    odometry, random = LidarOdometry(), np.random.default_rng(0)
    for index in range(4):
        pose = from_euler(0, 0, 0, np.array([4.0 * index, 0, 0]))  # 40 m/s
        scan = random.uniform(200, 300, (500, 4)).astype(np.float32)  # fits to none before
        found = odometry.update(scan, index * STEP_S, pose)
        np.testing.assert_allclose(found.world_SE3_velo, pose, atol=1e-9)


@pytest.mark.parametrize("jump_m", [4.0, 20.0])
def test_an_ins_jump_of_metres_is_refused_by_name(jump_m: float) -> None:
    truth = path(3)
    odometry = LidarOdometry()
    for index in range(2):
        odometry.update(observed_from(truth[index], index), index * STEP_S, truth[index])
    jumped = truth[2].copy()
    jumped[1, 3] += jump_m
    with pytest.raises(PoseError) as error:
        odometry.update(observed_from(truth[2], 2), 2 * STEP_S, jumped, "oxts 0002")
    assert error.value.where == "oxts 0002"
    assert error.value.found.startswith("a jump of")


def test_an_ins_that_turns_faster_than_a_vehicle_is_refused() -> None:
    truth = path(3)
    odometry = LidarOdometry()
    for index in range(2):
        odometry.update(observed_from(truth[index], index), index * STEP_S, truth[index])
    turned = truth[2] @ from_euler(0, 0, np.radians(40))
    with pytest.raises(PoseError) as error:
        odometry.update(observed_from(truth[2], 2), 2 * STEP_S, turned, "oxts 0002")
    assert " m and 40." in error.value.found or " m and 39." in error.value.found


def test_an_ins_slip_of_a_metre_is_repaired() -> None:
    truth = path(4)
    odometry = LidarOdometry()
    slip = from_euler(0, 0, 0, np.array([0.3, 0.9, 0.0]))
    for index, pose in enumerate(truth):
        ins = pose @ slip if index == 3 else pose
        found = odometry.update(observed_from(pose, index), index * STEP_S, ins)
    assert found.origin is PoseOrigin.REGISTERED
    assert apart(truth[3], found.world_SE3_velo)[0] < 0.01


def test_a_long_gap_resets_the_window_and_follows_the_ins() -> None:
    truth = path(40)
    odometry = LidarOdometry()
    for index in (0, 1):
        odometry.update(observed_from(truth[index], index), index * STEP_S, truth[index])
    found = odometry.update(observed_from(truth[39], 39), 39 * STEP_S, truth[39])
    assert found.is_reset
    assert found.origin is PoseOrigin.INS
    assert apart(truth[39], found.world_SE3_velo)[0] < 0.05


def test_a_few_missing_frames_are_bridged() -> None:
    truth = path(8)
    odometry = LidarOdometry()
    for index in (0, 1, 2, 7):
        found = odometry.update(observed_from(truth[index], index), index * STEP_S)
    assert found.origin is PoseOrigin.REGISTERED
    assert apart(truth[7], found.world_SE3_velo)[0] < 0.02


def test_scans_of_once_a_second_are_registered_though_their_stamps_jitter() -> None:
    truth = path(31, speed_m_s=3.0)[::10]
    odometry = LidarOdometry()
    for index, stamp_s in enumerate([0.0, 1.03, 2.01, 3.06]):
        found = odometry.update(observed_from(truth[index], index), stamp_s, truth[index])
        assert found.origin is (PoseOrigin.REGISTERED if index else PoseOrigin.START)


def test_a_repeated_stamp_repeats_the_pose_and_a_falling_one_is_refused() -> None:
    odometry = LidarOdometry()
    odometry.update(observed_from(np.eye(4), 0), 5.0)
    again = odometry.update(observed_from(np.eye(4), 0), 5.0)
    assert again.origin is PoseOrigin.REPEATED
    assert not again.is_reset
    np.testing.assert_array_equal(again.world_SE3_velo, np.eye(4))
    with pytest.raises(PoseError) as error:
        odometry.update(observed_from(np.eye(4), 0), 4.9, source="frame 2")
    assert error.value.where == "frame 2"


def test_orthonormal_repairs_printed_digits() -> None:
    truth = from_euler(0.1, -0.2, 0.3, np.array([1.0, 2.0, 3.0]))
    repaired = orthonormal(np.round(truth, 5))
    np.testing.assert_allclose(repaired[:3, :3] @ repaired[:3, :3].T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(repaired, truth, atol=1e-5)


def test_real_scans_agree_to_centimetres_without_ins(kitti_root: Path) -> None:
    """Six scans carried one by one must lie as the first lies on the last directly."""
    folder = kitti_root / "raw/2011_09_26/2011_09_26_drive_0005_sync/velodyne_points/data"
    odometry = LidarOdometry()
    scans = []
    for index in range(6):
        scan = np.fromfile(folder / f"{index:010d}.bin", np.float32).reshape(-1, 4)
        pose = odometry.update(scan, index * STEP_S).world_SE3_velo
        scans.append((scan, pose))
    (first, first_pose), (last, last_pose) = scans[0], scans[-1]
    target, source = preprocess_points(last, 0.3), preprocess_points(first, 0.3)
    seed = inverse(last_pose) @ first_pose
    direct = align(target, source, seed, max_correspondence_m=0.3)
    metres, degrees = apart(seed, direct.target_SE3_source)
    assert np.linalg.norm(seed[:3, 3]) > 1.5  # the car did drive
    assert metres < 0.03
    assert degrees < 0.06


def test_a_real_first_motion_is_found_though_iterations_run_out(kitti_root: Path) -> None:
    folder = kitti_root / "tracking/training/velodyne/0000"
    scans = [
        np.fromfile(folder / f"{index:06d}.bin", np.float32).reshape(-1, 4)
        for index in range(55, 61)
    ]
    at_once, one_by_one = LidarOdometry(), LidarOdometry()
    for index, scan in enumerate(scans):
        expected = one_by_one.update(scan, index * STEP_S)
    at_once.update(scans[0], 0.0)
    found = at_once.update(scans[-1], 5 * STEP_S)
    assert found.origin is PoseOrigin.REGISTERED
    metres, degrees = apart(expected.world_SE3_velo, found.world_SE3_velo)
    assert metres < 0.05
    assert degrees < 0.1


@pytest.mark.parametrize(
    "points",
    [np.zeros((0, 4)), np.array([[1e9, 0, 0, 0], [np.nan, 0, 0, 0]]), np.zeros((3, 4))],
    ids=["empty", "out of range", "too few"],
)
def test_scans_without_points_are_met_in_silence(points, capfd):
    odometry = LidarOdometry()
    for number, scan in enumerate([points, street(), points, points]):
        odometry.update(scan.astype(np.float32), number * STEP_S)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("speed_m_s", "turn_rad_s"), [(0.0, 0.0), (6.0, 0.5), (25.0, -0.2)])
def test_the_first_motion_is_found_at_two_scans_a_second(
    speed_m_s: float, turn_rad_s: float
) -> None:
    poses = path(16, speed_m_s, turn_rad_s)[::5]
    odometry = LidarOdometry()
    found = [
        odometry.update(observed_from(pose, seed), 0.5 * seed) for seed, pose in enumerate(poses)
    ]
    assert all(one.origin is PoseOrigin.REGISTERED for one in found[1:])
    for one, pose in zip(found, poses, strict=True):
        off_m, off_deg = apart(pose, one.world_SE3_velo)
        assert off_m < 0.05 and off_deg < 0.2


def test_a_false_turn_of_the_ins_is_not_followed_at_two_scans_a_second() -> None:
    poses = path(36, 6.0, 0.1)[::5]
    odometry = LidarOdometry()
    for index, pose in enumerate(poses):
        turned = pose @ from_euler(0, 0, np.radians(10) * max(0, index - 3))
        found = odometry.update(observed_from(pose, index), 0.5 * index, turned)
        off_m, off_deg = apart(pose, found.world_SE3_velo)
        assert off_m < 0.1 and off_deg < 0.3


def test_a_turn_that_begins_between_distant_scans_is_found_without_ins() -> None:
    # Twice a second; from the fourth scan on 12 degrees a step, where a constant velocity goes straight on.
    truth = [np.eye(4)]
    for index in range(7):
        turn_rad = np.radians(0 if index < 3 else 12)
        truth.append(truth[-1] @ from_euler(0, 0, turn_rad, np.array([1.5, 0, 0])))
    odometry = LidarOdometry()
    for index, pose in enumerate(truth):
        found = odometry.update(observed_from(pose, index), 0.5 * index)
        assert found.origin is (PoseOrigin.REGISTERED if index else PoseOrigin.START)
        assert not (index and found.is_reset)
        away_m, turned_deg = apart(pose, found.world_SE3_velo)
        assert away_m < 0.05
        assert turned_deg < 0.3


def test_a_lost_pose_is_found_again_while_the_keyframe_is_seen() -> None:
    odometry, truth = LidarOdometry(), path(16)
    found = []
    for index, pose in enumerate(truth):
        points = observed_from(pose, index)
        found.append(odometry.update(points[:20] if 3 < index < 7 else points, index * STEP_S))
    assert [one.origin for one in found[4:7]] == [PoseOrigin.EXTRAPOLATED] * 3
    assert not any(one.is_reset for one in found[1:])
    assert found[7].origin is PoseOrigin.REGISTERED
    assert apart(truth[7], found[7].world_SE3_velo)[0] < 0.03


def test_the_world_is_reset_where_a_pose_is_lost_for_long() -> None:
    odometry, truth = LidarOdometry(), path(16)
    found = []
    for index, pose in enumerate(truth):
        points = observed_from(pose, index)
        found.append(odometry.update(points[:20] if index > 2 else points, index * STEP_S))
    resets = [index for index, one in enumerate(found) if one.is_reset]
    # The keyframe is the first scan: after 1.1 s it is given up.
    assert resets == [0, 12, *range(13, 16)][: len(resets)]
    assert resets[1] == 12
