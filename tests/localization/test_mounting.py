"""A LiDAR that stands wrong is told from one scan; one that stands right is never accused."""

import numpy as np
import pytest

from perception.errors import MountingError
from perception.geometry.se3 import from_euler, transform_points
from perception.localization import mounting
from perception.localization.mounting import check_mounting
from perception.sensor import HDL_32E, HDL_64E, SENSORS, VLP_16, LidarModel
from tests.rays import unit_rays

UPSIDE_DOWN = from_euler(np.pi, 0, 0)


def street(
    sensor: LidarModel,
    walls_m: float = 6.0,
    wall_height_m: float = 10.0,
    ceiling_m: float | None = None,
    tilt_rad: float = 0.0,
) -> np.ndarray:
    """Cast a sensor's rays into a street between two walls, under a ceiling in a tunnel."""
    rays = unit_rays(np.linspace(-np.pi, np.pi, 720), sensor.elevations_rad)
    rays = rays @ from_euler(tilt_rad, tilt_rad, 0)[:3, :3].T
    planes_m = [(2, -sensor.height_m), (1, walls_m), (1, -walls_m)]
    planes_m += [(2, ceiling_m)] if ceiling_m else []
    with np.errstate(divide="ignore"):
        ranges_m = np.stack([distance / rays[:, axis] for axis, distance in planes_m])
    ranges_m[ranges_m <= 0] = np.inf
    points = rays * ranges_m.min(axis=0)[:, None]
    seen = (ranges_m.min(axis=0) < sensor.max_range_m) & (points[:, 2] < wall_height_m)
    points = points[seen] @ from_euler(tilt_rad, tilt_rad, 0)[:3, :3]
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


SCENES = {
    "street": {},
    "narrow street": {"walls_m": 2.2},
    "wide road": {"walls_m": 40.0, "wall_height_m": 3.0},
    "tunnel": {"walls_m": 4.0, "ceiling_m": 3.0},
    "low car park": {"walls_m": 12.0, "ceiling_m": 0.5},
    "tilted": {"tilt_rad": 0.05},
}


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=SENSORS)
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_a_lidar_mounted_right_passes(sensor, scene):
    check_mounting(street(sensor, **scene), sensor)


@pytest.mark.parametrize("sensor", [HDL_64E, HDL_32E, VLP_16], ids=lambda sensor: sensor.name)
@pytest.mark.parametrize("scene", ["street", "wide road"])
def test_a_lidar_upside_down_is_reported(sensor, scene):
    points_velo = transform_points(UPSIDE_DOWN, street(sensor, **SCENES[scene]))
    with pytest.raises(MountingError) as error:
        check_mounting(points_velo, sensor, "0007.bin")
    assert error.value.where == "0007.bin"
    height_m, direction = error.value.found.split()[2:5:2]
    assert float(height_m) == pytest.approx(1.73, abs=0.3)
    assert direction == "above"
    assert error.value.advice.startswith("the LiDAR is mounted upside down: rotate")


@pytest.mark.parametrize(
    ("velo_SE3_true", "up"),
    [
        (from_euler(-np.pi / 2, 0, 0), "+y"),
        (from_euler(np.pi / 2, 0, 0), "-y"),
        (from_euler(0, np.pi / 2, 0), "+x"),
        (from_euler(0, -np.pi / 2, 0), "-x"),
    ],
    ids=["y", "-y", "x", "-x"],
)
def test_swapped_axes_are_reported(velo_SE3_true, up):
    points_velo = transform_points(velo_SE3_true, street(HDL_64E))
    with pytest.raises(MountingError) as error:
        check_mounting(points_velo, HDL_64E)
    assert error.value.found == f"{up} pointing up"
    assert error.value.expected == "a LiDAR with x forward, y left and z up"


@pytest.mark.parametrize("change_m", [-0.9, 0.9])
def test_another_height_is_reported(change_m):
    points_velo = street(HDL_64E) - np.float32([0, 0, change_m, 0])
    with pytest.raises(MountingError) as error:
        check_mounting(points_velo, HDL_64E)
    assert error.value.found == f"the ground {1.73 + change_m:.2f} m below the LiDAR"


def test_a_scan_that_shows_no_ground_is_let_pass():
    check_mounting(np.ones((5, 4), np.float32), HDL_64E)


def test_real_scans(kitti_root):
    paths = sorted((kitti_root / "raw").glob("*/*/velodyne_points/data/*.bin"))[::10]
    paths += sorted((kitti_root / "object/training/velodyne").glob("*.bin"))
    for path in paths:
        points_velo = np.fromfile(path, np.float32).reshape(-1, 4)
        check_mounting(points_velo, HDL_64E, str(path))
        with pytest.raises(MountingError) as error:
            check_mounting(transform_points(UPSIDE_DOWN, points_velo), HDL_64E)
        assert error.value.found.endswith("m above the LiDAR")
    assert len(paths) == 16 + 27


def test_a_ground_at_the_right_height_passes_under_a_lower_plane(monkeypatch):
    """Few points lie on what bounds the scan from below, as in a ditch, and many on the road."""
    monkeypatch.setattr(mounting, "_bounding_plane", lambda *_, **__: mounting._Plane(4.0, 0.01))
    monkeypatch.setattr(mounting, "_ground", lambda *_, **__: mounting._Plane(1.77, 0.6))
    check_mounting(street(HDL_64E), HDL_64E)
