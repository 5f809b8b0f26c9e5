from collections.abc import Callable

import numpy as np
import pytest

from perception.errors import UsageError
from perception.geometry.grids import SURROUNDINGS, LocalArea
from perception.geometry.se3 import from_euler, inverse
from perception.localization.scan_window import PosedScan, ScanWindow
from perception.obstacles.config import GroundSurfaceConfig
from perception.obstacles.ground_surface import GroundSurfaceEstimator
from perception.sensor import HDL_32E, HDL_64E, VLP_16, LidarModel

Ground = Callable[[np.ndarray, np.ndarray], np.ndarray]
Box = tuple[float, float, float, float]  # low x, low y, high x, high y


def rings(sensor: LidarModel, ground: Ground, boxes: list[Box], seed: int = 0) -> np.ndarray:
    """Scan a ground z = f(x, y) with 2 cm of noise, behind boxes that are 1.5 m high and hide it."""
    random = np.random.default_rng(seed)
    down = sensor.elevations_rad[sensor.elevations_rad < -0.02]
    azimuth = np.arange(0, 2 * np.pi, 4 * sensor.azimuth_step_rad)
    reach_m = np.minimum(sensor.height_m / np.tan(-down), 60.0)
    x, y = (np.outer(reach_m, f(azimuth)).ravel() for f in (np.cos, np.sin))
    z = ground(x, y) + random.normal(0, 0.02, len(x))
    for low_x, low_y, high_x, high_y in boxes:
        # March along each ray to where it first meets the box; stand the point on its side there.
        for share in np.linspace(0, 1, 200):
            inside = (x * share > low_x) & (x * share < high_x)
            inside &= (y * share > low_y) & (y * share < high_y)
            if share < 1:
                z[inside] = (ground(x, y) + random.uniform(0.2, 1.5, len(x)))[inside]
                x[inside], y[inside] = x[inside] * share, y[inside] * share
    points = np.column_stack([x, y, z, np.full(len(x), 0.3)])
    return points.astype(np.float32)


def window_of(*scans: PosedScan) -> ScanWindow:
    window = ScanWindow(previous_scans=6)
    for scan in scans:
        window.push(scan)
    return window


def errors_m(
    surface: GroundSurfaceEstimator, ground: Ground, sensor: LidarModel, boxes: list[Box]
) -> np.ndarray:
    """Return height errors on a 1 m lattice over the local area."""
    model = surface.update(window_of(PosedScan(rings(sensor, ground, boxes), np.eye(4))))
    x, y = np.meshgrid(np.arange(-4.5, 25), np.arange(-9.5, 10))
    xy = np.column_stack([x.ravel(), y.ravel()])
    return model.height_m(xy) - ground(*xy.T)


def level(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.full_like(x, -1.73)


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return -1.73 + 0.10 * x


def camber(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return -1.70 - 0.025 * np.abs(y)


def crest(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return -1.73 - 0.002 * x**2


def kerb(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.where(y > 5.0, -1.73 + 0.12, -1.73)


CAR = (9.0, -4.0, 13.0, -2.2)
VAN = (6.0, 3.0, 11.0, 5.0)


@pytest.mark.parametrize(
    ("ground", "mean_m", "worst_m"),
    [
        (level, 0.004, 0.02),
        (slope, 0.006, 0.04),
        (camber, 0.006, 0.03),
        (crest, 0.01, 0.05),
    ],
)
@pytest.mark.parametrize("boxes", [[], [CAR, VAN]])
def test_smooth_roads_are_found_to_millimetres(
    ground: Ground, mean_m: float, worst_m: float, boxes: list[Box]
) -> None:
    errors = np.abs(errors_m(GroundSurfaceEstimator(HDL_64E), ground, HDL_64E, boxes))
    assert errors.mean() < mean_m
    assert errors.max() < worst_m


def test_a_kerb_is_followed_on_both_sides() -> None:
    errors = np.abs(errors_m(GroundSurfaceEstimator(HDL_64E), kerb, HDL_64E, []))
    assert errors.mean() < 0.01
    assert errors.max() < 0.07  # within half a cell of the step, a smooth surface halves it


@pytest.mark.parametrize("sensor", [HDL_32E, VLP_16])
@pytest.mark.parametrize("ground", [level, slope, camber])
def test_sparse_sensors_need_no_other_settings(sensor: LidarModel, ground: Ground) -> None:
    errors = np.abs(errors_m(GroundSurfaceEstimator(sensor), ground, sensor, [CAR]))
    assert errors.mean() < 0.02
    assert np.percentile(errors, 95) < 0.06


def bank_m(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of a road, 10 m wide, that runs on a bank 1 m above the land."""
    share = np.clip((np.abs(y) - 5.0) / 6.0, 0.0, 1.0)
    return -1.73 - share**2 * (3 - 2 * share)


@pytest.mark.parametrize("sensor", [VLP_16, HDL_32E, HDL_64E])
def test_a_road_on_a_bank_is_found_between_sparse_rings(sensor: LidarModel) -> None:
    surface = GroundSurfaceEstimator(sensor, SURROUNDINGS)
    model = surface.update(window_of(PosedScan(rings(sensor, bank_m, [CAR]), np.eye(4))))
    x, y = np.meshgrid(np.arange(-12.0, 12.5, 0.5), np.arange(-4.0, 4.5, 0.5))
    road = np.column_stack([x.ravel(), y.ravel()])
    np.testing.assert_allclose(model.height_m(road), -1.73, atol=0.1)


def test_rows_of_parked_cars_do_not_lift_the_road_between_them() -> None:
    row = [(x, y, x + 4.2, y + 1.8) for x in (-4.0, 1.5, 7.0, 12.5, 18.0) for y in (-4.5, 2.7)]
    scan = PosedScan(rings(HDL_64E, level, row), np.eye(4))
    model = GroundSurfaceEstimator(HDL_64E).update(window_of(scan))
    road = np.column_stack([np.repeat(np.arange(-4, 25), 5), np.tile(np.arange(-2, 3), 29)])
    under_cars = np.array([[x + 2.1, y + 0.9] for x, y, _, _ in row])
    np.testing.assert_allclose(model.height_m(road), -1.73, atol=0.02)
    np.testing.assert_allclose(model.height_m(under_cars), -1.73, atol=0.05)


def test_ghost_points_below_the_ground_do_not_sink_it() -> None:
    points = rings(HDL_64E, level, [])
    ghosts = np.random.default_rng(4).choice(len(points), len(points) // 50, replace=False)
    points[ghosts, 2] -= np.random.default_rng(5).uniform(0.3, 0.7, len(ghosts)).astype(np.float32)
    model = GroundSurfaceEstimator(HDL_64E).update(window_of(PosedScan(points, np.eye(4))))
    assert abs(model.height_m(np.array([[10.0, 0.0]]))[0] + 1.73) < 0.01


def test_earlier_scans_fill_what_the_newest_does_not_see() -> None:
    """A hump is seen, then hidden by a wall: only the memory knows it."""

    def bump(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return -1.73 + 0.2 * np.exp(-((x - 14.0) ** 2 + y**2) / 18.0)

    wall = (9.0, -6.0, 9.5, 6.0)
    move = from_euler(0, 0, 0.0, np.array([1.0, 0.0, 0.0]))

    def bump_ahead(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return bump(x + 1.0, y)

    ground = GroundSurfaceEstimator(HDL_64E)
    first = PosedScan(rings(HDL_64E, bump, []), np.eye(4))
    second = PosedScan(rings(HDL_64E, bump_ahead, [wall]), move)
    ground.update(window_of(first))
    top = np.array([[13.0, 0.0]])
    remembered = ground.update(window_of(first, second)).height_m(top)[0]
    forgotten = GroundSurfaceEstimator(HDL_64E).update(window_of(second)).height_m(top)[0]
    assert abs(remembered - (-1.73 + 0.2)) < 0.02
    assert abs(forgotten - (-1.73 + 0.2)) > 0.08


@pytest.mark.parametrize("turned", [0, 1])
@pytest.mark.parametrize(("is_stated", "bent_m"), [(False, 0.49), (True, 0.0)])
def test_a_scan_of_doubtful_pose_bends_no_ground(
    turned: int, is_stated: bool, bent_m: float
) -> None:
    """Of two scans of a level road, the second behind a wall, one has a pose that is pitched by two degrees."""
    pitch_rad = np.radians(2.0)
    doubt = np.diag([0, 0, 0, 0, pitch_rad**2 if is_stated else 0.0, 0])
    scans = [
        PosedScan(
            rings(HDL_64E, level, walls),
            from_euler(0, pitch_rad if number == turned else 0.0, 0),
            doubt if number == turned else np.zeros((6, 6)),
        )
        for number, walls in enumerate([[], [(9.0, -6.0, 9.5, 6.0)]])
    ]
    ground = GroundSurfaceEstimator(HDL_64E)
    ground.update(window_of(scans[0]))
    hidden_m = ground.update(window_of(*scans)).height_m(np.array([[14.0, 0.0]]))[0]
    assert abs(hidden_m + 1.73) == pytest.approx(bent_m, abs=0.02)


def test_a_window_of_one_scan_resets() -> None:
    def high(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.full_like(x, -1.5)

    used, fresh = GroundSurfaceEstimator(HDL_64E), GroundSurfaceEstimator(HDL_64E)
    scan = PosedScan(rings(HDL_64E, level, [VAN]), np.eye(4))
    used.update(window_of(PosedScan(rings(HDL_64E, high, []), np.eye(4))))
    np.testing.assert_array_equal(
        used.update(window_of(scan)).heights_m, fresh.update(window_of(scan)).heights_m
    )


def test_the_surface_moves_with_the_vehicle() -> None:
    """The same world from two poses gives the same world heights."""
    poses = [np.eye(4), from_euler(0.0, 0.02, 0.1, np.array([2.0, 0.3, 0.05]))]
    ground, scans = GroundSurfaceEstimator(HDL_64E), []
    for pose in poses:
        world = rings(HDL_64E, level, [])
        world[:, :3] += np.random.default_rng(0).normal(0, 0.001, (len(world), 3))
        velo_SE3_world = inverse(pose)
        local = world.copy()
        local[:, :3] = world[:, :3] @ velo_SE3_world[:3, :3].T + velo_SE3_world[:3, 3]
        scans.append(PosedScan(local, pose))
        model = ground.update(window_of(*scans))
        xy = np.array([[5.0, 3.0], [15.0, -4.0]])
        points = np.column_stack([xy, model.height_m(xy)]) @ pose[:3, :3].T + pose[:3, 3]
        np.testing.assert_allclose(points[:, 2], -1.73, atol=0.01)


def test_same_input_gives_the_same_surface() -> None:
    scan = PosedScan(rings(HDL_64E, camber, [CAR]), np.eye(4))
    first, again = (GroundSurfaceEstimator(HDL_64E).update(window_of(scan)) for _ in range(2))
    np.testing.assert_array_equal(first.heights_m, again.heights_m)


def test_no_returns_are_level_ground_at_the_sensors_height() -> None:
    far = np.array([[90.0, 0, 0, 0]], np.float32)
    model = GroundSurfaceEstimator(HDL_64E).update(window_of(PosedScan(far, np.eye(4))))
    np.testing.assert_allclose(model.heights_m, -1.73, atol=1e-9)


def test_the_grid_covers_the_area_and_its_margin() -> None:
    area = LocalArea(ahead_m=40, behind_m=10, side_m=15)
    scan = PosedScan(rings(HDL_64E, level, []), np.eye(4))
    grid = GroundSurfaceEstimator(HDL_64E, area).update(window_of(scan)).grid
    low, high = grid.nodes_xy_m[0], grid.nodes_xy_m[-1]
    np.testing.assert_allclose([*low, *high], [-13, -18, 43, 18])


@pytest.mark.parametrize("boxes", [[], [CAR, VAN]])
@pytest.mark.parametrize("ground", [slope, camber, crest, kerb])
def test_a_wide_area_has_the_ground_of_a_small_one_nearby(ground: Ground, boxes: list[Box]) -> None:
    """Nodes are close together nearby, as everywhere in a small area, and far apart beyond."""
    nearby = LocalArea(ahead_m=30.0, behind_m=10.0)
    scan = PosedScan(rings(HDL_64E, ground, boxes), np.eye(4))
    small, wide = (
        GroundSurfaceEstimator(HDL_64E, area).update(window_of(scan))
        for area in (nearby, LocalArea(50.0, 50.0, 50.0))
    )
    x, y = np.meshgrid(np.arange(-9.5, 30), np.arange(-9.5, 10))
    xy_m = np.column_stack([x.ravel(), y.ravel()])
    errors_m = np.abs(wide.height_m(xy_m) - small.height_m(xy_m))
    assert errors_m.mean() < 0.002
    assert errors_m.max() < 0.03


def test_the_surfaces_nearby_and_beyond_pass_into_each_other() -> None:
    scan = PosedScan(rings(HDL_64E, kerb, []), np.eye(4))
    wide = GroundSurfaceEstimator(HDL_64E, LocalArea(50.0, 50.0, 50.0)).update(window_of(scan))
    heights_m = wide.heights_m.reshape(wide.grid.nodes_x, wide.grid.nodes_y)
    assert heights_m.shape == (107, 107)
    assert np.abs(np.diff(heights_m, axis=0)).max() < 0.05
    assert np.abs(np.diff(heights_m, axis=1)).max() < 0.08  # the kerb


@pytest.mark.parametrize("ground", [slope, camber, crest])
def test_roads_of_a_junction_are_found_as_well(ground: Ground) -> None:
    surface = GroundSurfaceEstimator(HDL_64E, LocalArea(40.0, 40.0, 40.0))
    assert np.abs(errors_m(surface, ground, HDL_64E, [])).mean() < 0.01


def test_sizes_that_make_no_grid_are_refused() -> None:
    with pytest.raises(UsageError) as error:
        GroundSurfaceConfig(cell_m=0.0)
    assert error.value.where == "ground surface"
    assert "cell_m=0.0" in error.value.found
