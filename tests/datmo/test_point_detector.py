import numpy as np
import pytest

from perception.datmo.detector import DetectedObjects, SegmentedScan
from perception.datmo.point_detector import PointDetector, StaticCells
from perception.sensor import HDL_64E, VLP_16, LidarModel
from perception.types import Float, Float64, PointState

HERE = np.eye(4)
SENSORS = pytest.mark.parametrize("sensor", [HDL_64E, VLP_16], ids=lambda sensor: sensor.name)


class Road:
    """A road that rises by a centimetre a metre ahead."""

    def height_m(self, xy_m: Float) -> Float64:
        return np.asarray(-1.7 + 0.01 * xy_m[:, 0], np.float64)

    def distance_m(self, points_velo: Float) -> Float64:
        return np.asarray(points_velo[:, 2] - self.height_m(points_velo), np.float64)


def wall(start: tuple[float, float], end: tuple[float, float], step_m: float = 0.1) -> np.ndarray:
    """Return points in a row over the ground plane, at heights from -1.4 m to -0.2 m."""
    length = np.hypot(end[0] - start[0], end[1] - start[1])
    share = np.linspace(0, 1, max(2, round(length / step_m) + 1))[:, None]
    flat = np.array(start) + share * (np.array(end) - np.array(start))
    heights = np.repeat([-1.4, -0.8, -0.2], len(flat))
    return np.column_stack([np.tile(flat, (3, 1)), heights])


def detect(
    moving: list[np.ndarray], static: list[np.ndarray], sensor: LidarModel = HDL_64E
) -> DetectedObjects:
    groups = [*moving, *static, np.array([[5.0, 0.0, -1.65], [50.0, 0.0, 3.0]])]
    states = np.concatenate(
        [
            np.full(sum(map(len, moving)), PointState.MOVING),
            np.full(sum(map(len, static)), PointState.STATIC),
            [PointState.GROUND, PointState.OUTSIDE],
        ]
    )
    points = np.concatenate(groups)
    points_velo = np.column_stack([points, np.zeros(len(points))]).astype(np.float32)
    scan = SegmentedScan(0.0, points_velo, states.astype(np.uint8), Road(), HERE, HERE)
    return PointDetector(sensor).detect(scan)


@SENSORS
def test_front_and_side_of_a_van_are_one_cluster(sensor):
    found = detect([wall((12, 2), (12, 3.8)), wall((12, 2), (16.5, 2), 0.3)], [], sensor)
    assert len(found.moving) == 1
    low_m, high_m = found.moving.extents_m(np.zeros(1))
    np.testing.assert_allclose(low_m, [[12, 2]], atol=1e-5)
    np.testing.assert_allclose(high_m, [[16.5, 3.8]], atol=1e-5)


def test_a_bumper_and_a_windscreen_are_one_cluster_across_a_gap():
    found = detect([wall((12, 0), (12, 1.6)), wall((13.1, 0), (13.1, 1.6))], [], VLP_16)
    assert len(found.moving) == 1


def test_two_cars_one_behind_the_other_are_two_clusters():
    found = detect([wall((12, 0), (12, 1.6)), wall((15, 0), (15, 1.6))], [], VLP_16)
    assert len(found.moving) == 2


@SENSORS
def test_two_pedestrians_side_by_side_are_two_clusters(sensor):
    """Half a metre of air across the line of sight parts them; along it they would be one."""
    beside = [wall((10, 0), (10, 0.4)), wall((10, 0.9), (10, 1.3))]
    behind = [wall((10, 0), (10.1, 0)), wall((10.55, 0), (10.65, 0))]
    assert len(detect(beside, [], sensor).moving) == 2
    assert len(detect(behind, [], sensor).moving) == 1


def test_clusters_reach_down_to_the_ground():
    found = detect([wall((10, 0), (10, 0.5))], [wall((10, -5), (10, -4))])
    np.testing.assert_allclose(found.moving.low_m, [-1.6], atol=1e-6)
    np.testing.assert_allclose(found.moving.high_m, [-0.2], atol=1e-6)
    np.testing.assert_allclose(found.static.low_m, [-1.6], atol=1e-6)
    np.testing.assert_allclose(found.static.high_m, [-0.2], atol=1e-6)
    assert found.moving.points.tolist() == [18]


def test_moving_points_of_few_beams_at_a_static_object_are_no_object():
    hedge = wall((5, 4), (20, 4))
    found = detect([wall((10, 3.9), (10.6, 3.9)), wall((15, 3), (15.5, 3))], [hedge], VLP_16)
    np.testing.assert_allclose(found.moving.centroids_m, [[15.25, 3]], atol=1e-5)


def test_a_walker_whom_many_beams_cross_may_brush_a_hedge():
    """1.2 m of him at 10 m are crossed by 16 beams of an HDL-64E, and at 20 m by 8."""
    hedge = wall((5, 4), (25, 4))
    near, far = wall((10, 3.9), (10.6, 3.9)), wall((20, 3.9), (20.6, 3.9))
    found = detect([near, far], [hedge], HDL_64E)
    np.testing.assert_allclose(found.moving.centroids_m, [[10.3, 3.9]], atol=1e-5)


def test_a_walker_who_passes_a_post_moves():
    walker, post = wall((10, 2.0), (10, 2.6)), wall((10, 2.8), (10, 2.85))
    assert len(detect([walker], [post]).moving) == 1


def test_cars_are_static_objects_and_walls_are_not():
    car, house = wall((10, -4), (14, -4)), wall((0, 8), (20, 8))
    found = detect([], [car, house])
    assert len(found.static) == 1
    low_m, high_m = found.static.extents_m(np.zeros(1))
    np.testing.assert_allclose([low_m[0, 0], high_m[0, 0]], [10, 14], atol=0.1)  # half a cell
    assert found.static.points.tolist() == [3 * 41]


def test_two_points_are_no_cluster():
    found = detect([np.array([[10.0, 1.0, -1.0], [10.1, 1.0, -1.0]])], [wall((0, 5), (0.1, 5))])
    assert len(found.moving) == 0
    assert len(found.static) == 1


def test_an_empty_scan_has_no_detection():
    found = detect([], [])
    assert len(found.moving) == len(found.static) == 0


def test_the_order_of_the_points_does_not_matter():
    parts = [wall((12, 2), (12, 3.8)), wall((20, -2), (20, -1.5)), wall((6, 0), (6, 0.5))]
    one = detect([np.concatenate(parts)], []).moving
    other = detect([np.concatenate(parts)[::-1]], []).moving
    order, same = np.argsort(one.centroids_m[:, 0]), np.argsort(other.centroids_m[:, 0])
    np.testing.assert_allclose(one.centroids_m[order], other.centroids_m[same], atol=1e-6)
    np.testing.assert_array_equal(one.points[order], other.points[same])
    assert len(one) == 3


def test_standing_cells_keep_mean_place_highest_point_and_count():
    points = np.array([[0.05, 0.05, 1.0], [0.15, 0.15, 3.0], [0.45, 0.05, 2.0]], np.float32)
    cells = StaticCells.under(points, 0.2)
    np.testing.assert_allclose(cells.places_m, [[0.1, 0.1, 3.0], [0.45, 0.05, 2.0]], atol=1e-6)
    assert cells.points.tolist() == [2, 1]
    places = np.array([[0.25, 0.1], [0.1, 0.65], [0.79, 0.0], [0.85, 0.0], [99.0, 99.0]])
    assert cells.is_touching(places).tolist() == [True, False, True, False, False]
