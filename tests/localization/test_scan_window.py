import numpy as np

from perception.geometry.grids import LocalArea
from perception.geometry.se3 import from_euler, inverse
from perception.localization.registration import register_window
from perception.localization.scan_window import PosedScan, ScanWindow, merge


def scan_of(points: list[tuple[float, float, float]]) -> np.ndarray:
    return np.column_stack([np.array(points), np.full(len(points), 0.5)]).astype(np.float32)


def random_window(scans: int) -> ScanWindow:
    random = np.random.default_rng(3)
    window = ScanWindow(previous_scans=scans - 1)
    for index in range(scans):
        points = np.column_stack([random.uniform(-40, 40, (500, 3)), random.uniform(0, 1, 500)])
        pose = from_euler(0.01 * index, 0.02, 0.1 * index, np.array([1.5 * index, 0.2, 0.05]))
        window.push(PosedScan(points.astype(np.float32), pose))
    return window


def merged_point_by_point(window: ScanWindow, area: LocalArea) -> np.ndarray:
    """Do (5.1) literally: one point at a time, to the world and back; rows x, y, z, r, age."""
    scans = list(window)
    newest_SE3_world = np.linalg.inv(scans[-1].world_SE3_velo)
    rows = []
    for age, scan in enumerate(reversed(scans)):
        for x, y, z, reflectance in scan.points_velo.tolist():
            world = scan.world_SE3_velo @ [x, y, z, 1]
            point = newest_SE3_world @ world
            inside = -area.behind_m < point[0] < area.ahead_m and abs(point[1]) < area.side_m
            if inside:
                rows.append([*point[:3], reflectance, age])
    return np.array(rows)


def test_merged_cloud_equals_the_naive_loop() -> None:
    window, area = random_window(4), LocalArea()
    cloud = merge(window, area)
    expected = merged_point_by_point(window, area)
    np.testing.assert_allclose(cloud.points_velo, expected[:, :4], atol=2e-5)
    np.testing.assert_array_equal(cloud.age, expected[:, 4])
    assert cloud.points_velo.dtype == np.float32


def test_a_world_point_seen_from_two_poses_merges_to_one_place() -> None:
    world = np.array([12.0, 2.0, 0.3, 1.0])
    window = ScanWindow(previous_scans=1)
    for pose in (from_euler(0, 0, 0.2, np.array([0.0, 1, 0])), from_euler(0, 0, 0, np.ones(3))):
        local = inverse(pose) @ world
        window.push(PosedScan(scan_of([tuple(local[:3])]), pose))
    cloud = merge(window, LocalArea())
    np.testing.assert_allclose(cloud.points_velo[:, :3], [[11, 1, -0.7]] * 2, atol=1e-6)
    np.testing.assert_array_equal(cloud.age, [0, 1])


def test_an_old_scan_brings_what_has_come_into_the_area_since() -> None:
    window = ScanWindow(previous_scans=1)
    window.push(PosedScan(scan_of([(30, 0, 0), (-4, 0, 0)]), np.eye(4)))
    window.push(PosedScan(scan_of([(1, 0, 0)]), from_euler(0, 0, 0, np.array([10.0, 0, 0]))))
    cloud = merge(window, LocalArea())
    np.testing.assert_allclose(cloud.points_velo[:, 0], [1, 20])


def test_a_margin_keeps_more() -> None:
    window = ScanWindow(previous_scans=0)
    window.push(PosedScan(scan_of([(26, 0, 0), (0, 11, 0), (40, 0, 0)]), np.eye(4)))
    assert len(merge(window, LocalArea()).points_velo) == 0
    assert len(merge(window, LocalArea(), margin_m=2).points_velo) == 2


def test_window_drops_the_oldest() -> None:
    window = random_window(3)
    newest = PosedScan(scan_of([(1, 0, 0)]), np.eye(4))
    window.push(newest)
    assert len(window) == 3
    assert window.newest is newest
    window.clear()
    assert len(window) == 0


def test_thesis_registration_pulls_the_scans_together() -> None:
    random = np.random.default_rng(0)
    floor = np.column_stack([random.uniform(-20, 20, (4000, 2)), np.full(4000, -1.7)])
    walls = np.column_stack(
        [random.uniform(-20, 20, 2000), random.choice([-9, 9], 2000), random.uniform(-1.7, 2, 2000)]
    )
    ends = np.column_stack([walls[:, 1] * 2, walls[:, 0] / 2, walls[:, 2]])
    points = scan_of(np.concatenate([floor, walls, ends]).tolist())
    wrong = from_euler(0, 0, 0.01, np.array([0.15, 0.1, 0.03]))
    window = ScanWindow(previous_scans=1)
    window.push(PosedScan(points, wrong))
    window.push(PosedScan(points, np.eye(4)))
    registered = register_window(window)
    before, after = (scan.world_SE3_velo for scan in registered)
    np.testing.assert_array_equal(after, np.eye(4))
    np.testing.assert_allclose(before, np.eye(4), atol=0.005)
    registered.push(PosedScan(points, np.eye(4)))
    assert len(registered) == 2  # as long as the window before
