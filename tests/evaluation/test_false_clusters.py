import numpy as np

from perception.evaluation.false_obstacles import (
    NO_OBJECT,
    MovingClusters,
    cluster_ids,
    moving_clusters,
)
from perception.evaluation.objects import LabelledObjects, LabelledView, MotionState
from perception.types import Boxes3D, Calibration, PointState

# A camera at the LiDAR's origin that looks ahead: u = 500 - 500 y / x, v = 200 - 500 z / x.
CAMERA = Calibration(
    image_P_cam=np.array([[500.0, 0, 500, 0], [0, 500, 200, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
)
SIZE_PX = (1000, 400)


def test_the_edge_of_a_region_is_in_it():
    view = LabelledView(CAMERA, SIZE_PX, np.array([[450.0, 150, 550, 250], [0, 0, 10, 10]]))
    # 500 px ahead and 200 px down is straight ahead: the corners, then points beside them.
    points = np.array([[10, 1, 1], [10, -1, -1], [10, 1.01, 0], [10, 0, -1.01], [10, -1.01, 0]])
    assert view.is_dont_care(points).tolist() == [True, True, False, False, False]


def clump(x_m: float, y_m: float, count: int = 6) -> np.ndarray:
    """Return points within one cell of 0.2 m, 1 m below the LiDAR."""
    spread = np.linspace(0.01, 0.05, count)
    return np.column_stack([x_m + spread, y_m + spread, np.full(count, -1.0), np.zeros(count)])


def annotations(
    *places: tuple[float, MotionState], dont_care_px: np.ndarray | None = None
) -> tuple[LabelledObjects, LabelledView]:
    """Return 2 m cubes straight ahead at these distances."""
    count = len(places)
    bottom_m = np.array([[x, 0.0, -1.7] for x, _ in places]).reshape(-1, 3)
    objects = LabelledObjects(
        boxes_velo=Boxes3D(bottom_m, np.full((count, 3), 2.0), np.zeros(count)),
        motions=np.array([motion for _, motion in places], np.int64),
        track_ids=np.arange(count),
    )
    regions = np.zeros((0, 4)) if dont_care_px is None else dont_care_px
    return objects, LabelledView(CAMERA, SIZE_PX, regions)


def clusters_of(
    points_velo: np.ndarray, surroundings: tuple[LabelledObjects, LabelledView]
) -> MovingClusters:
    states = np.full(len(points_velo), PointState.MOVING, np.uint8)
    return moving_clusters(4, points_velo, states, *surroundings)


def test_near_clumps_are_one_cluster_and_far_ones_are_two():
    near = np.array([[5.1, 0.1], [5.5, 0.1], [5.9, 0.1]])  # one free cell between each
    assert cluster_ids(near).tolist() == [0, 0, 0]
    far = np.array([[5.1, 0.1], [6.1, 0.1], [5.1, 0.1]])
    assert cluster_ids(far).tolist() == [0, 1, 0]


def test_without_closing_only_the_eight_neighbours_join():
    diagonal_and_apart = np.array([[0.1, 0.1], [0.3, 0.3], [0.7, 0.3]])
    assert cluster_ids(diagonal_and_apart, closing_m=0.0).tolist() == [0, 0, 1]


def test_what_a_cluster_touches_decides_what_it_is():
    points = np.concatenate([clump(10, 0), clump(15.2, 0), clump(20, 0), clump(24, 5)])
    clusters = clusters_of(
        points,
        annotations((10, MotionState.MOVING), (14, MotionState.STATIC), (20, MotionState.UNKNOWN)),
    )
    order = np.argsort(clusters.centers_m[:, 0])
    # The second is 0.2 m behind the static box, within its margin.
    expected = [MotionState.MOVING, MotionState.STATIC, MotionState.UNKNOWN, NO_OBJECT]
    assert clusters.object_motions[order].tolist() == expected
    assert clusters.points.tolist() == [6, 6, 6, 6]
    assert clusters.frames.tolist() == [4, 4, 4, 4]
    centers_m = [[10.03, 0.03], [15.23, 0.03], [20.03, 0.03], [24.03, 5.03]]
    np.testing.assert_allclose(clusters.centers_m[order], centers_m, atol=1e-9)
    false = clusters.is_false(5, ignore_dont_care=True)[order]
    assert false.tolist() == [False, True, False, True]


def test_a_cluster_that_touches_two_objects_belongs_to_the_moving_one():
    clusters = clusters_of(
        clump(12, 0), annotations((11, MotionState.STATIC), (13, MotionState.MOVING))
    )
    assert clusters.object_motions.tolist() == [MotionState.MOVING]


def test_clusters_behind_the_camera_or_too_small_are_not_false():
    clusters = clusters_of(np.concatenate([clump(-4, 0), clump(10, 0, count=2)]), annotations())
    assert not clusters.is_false(5, ignore_dont_care=True).any()
    assert clusters.is_false(1, ignore_dont_care=True).sum() == 1


def test_dont_care_regions_excuse_where_asked():
    # At x = 10, 1 m down: u = 500, v = 250.
    regions = np.array([[480.0, 240.0, 520.0, 260.0]])
    clusters = clusters_of(clump(10, 0), annotations(dont_care_px=regions))
    assert clusters.is_false(5, ignore_dont_care=True).tolist() == [False]
    assert clusters.is_false(5, ignore_dont_care=False).tolist() == [True]


def test_a_scan_without_moving_points_has_no_cluster():
    states = np.full(6, PointState.STATIC, np.uint8)
    clusters = moving_clusters(0, clump(10, 0), states, *annotations((10, MotionState.MOVING)))
    assert len(clusters) == 0
    assert len(MovingClusters.concatenate([clusters, clusters])) == 0
