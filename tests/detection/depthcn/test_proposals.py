from pathlib import Path

import numpy as np
import pytest
from sklearn.cluster import DBSCAN

from benchmarks.reference.proposals import boxes_by_loop
from data.open_drive import open_drive
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.above_ground import find_above_ground
from perception.detection.depthcn.proposals import Proposals, cluster_points, fit_boxes, propose
from perception.geometry.box_overlap_px import iou_px
from perception.sensor import VLP_16
from perception.types import Calibration

# x forward of the LiDAR is z of the camera; 100 px of focal length.
CALIBRATION = Calibration(
    image_P_cam=np.array([[100.0, 0, 100, 0], [0, 100, 50, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
)
SIZE = (200, 100)
METHODS = ("default", "thesis")


def as_scan(xyz):
    return np.column_stack([xyz, np.full(len(xyz), 0.5)]).astype(np.float32)


def ground(generator, count=4000):
    return generator.uniform((5, -10, -1.51), (30, 10, -1.49), (count, 3))


def upright(x, low, high, count=300, generator=None):
    """Return points of an upright face at a distance, between two corners of y and z."""
    generator = generator or np.random.default_rng(1)
    yz = generator.uniform(low, high, (count, 2))
    return np.column_stack([np.full(count, float(x)), yz])


def scene(*objects):
    generator = np.random.default_rng(0)
    return as_scan(np.concatenate([ground(generator), *objects]))


@pytest.mark.parametrize("method", METHODS)
def test_each_obstacle_is_boxed_where_it_is_seen(method):
    # At x = 10, a metre is 10 px: y from 2 to 4 is u from 80 to 60, z from -1.5 to 0 is v from 65 to 50.
    scan = scene(upright(10, (2, -1.5), (4, 0)), upright(20.2, (-6, -1.5), (-2, 0.2)))
    found = propose(scan, CALIBRATION, SIZE, method=method)
    found = found[np.argsort(found.boxes_px[:, 0])]
    assert len(found) == 2
    expected = [[60, 45, 80, 65], [110, 44, 130, 57]]
    # The thesis keeps the ground in the cells of an obstacle: half a metre to a side, or nearer by.
    assert found.boxes_px == pytest.approx(
        np.array(expected), abs=1.5 if method == "default" else 6
    )
    assert found.depths_m == pytest.approx([10, 20.2], abs=0.3)
    assert np.bincount(found.clusters[4000:] + 1, minlength=3)[1:].min() > 200


def test_the_thesis_clusters_by_dbscan():
    scan = scene(upright(10, (2, -1.5), (4, 0)), upright(20.2, (-6, -1.5), (-2, 0.2), count=60))
    points = find_above_ground(scan, CALIBRATION, SIZE, 0.5, 0.01, "thesis")
    expected = DBSCAN(eps=0.5, min_samples=5).fit_predict(points.xy_m)
    assert set(expected) >= {0, 1}
    np.testing.assert_array_equal(cluster_points(points, 0.5, 5, "thesis"), expected)


def test_the_foot_of_what_is_hidden_below_is_on_the_ground():
    # Only its upper half is hit, and the ground just before it.
    before = np.column_stack([np.full(50, 9.4), np.linspace(2, 4, 50), np.full(50, -1.5)])
    scan = as_scan(np.concatenate([before, upright(10, (2, -0.8), (4, 0))]))
    found = propose(scan, CALIBRATION, SIZE)
    assert found.boxes_px[0].tolist() == [60, 45, 80, pytest.approx(65)]
    thesis = propose(scan, CALIBRATION, SIZE, method="thesis")
    assert thesis.boxes_px[0].tolist() == [60, 45, 80, 58]


def test_what_hangs_over_two_cars_does_not_tie_them():
    # Two cars 3 m apart under one crown that starts above their roofs.
    generator = np.random.default_rng(2)
    crown = generator.uniform((9.5, -4, 0.8), (10.5, 4, 2), (3000, 3))
    cars = [upright(10, (1.5, -1.5), (3.5, 0)), upright(10, (-3.5, -1.5), (-1.5, 0))]
    assert len(propose(scene(*cars, crown), CALIBRATION, SIZE)) == 2
    assert len(propose(scene(*cars, crown), CALIBRATION, SIZE, method="thesis")) == 1


def test_beams_part_with_range_and_so_does_the_neighbourhood():
    # Rows of points 0.9 m apart: one object at 60 m, as many as there are rows at 6 m.
    along, z = np.meshgrid(np.arange(4) * 0.9, np.linspace(-0.9, 0, 8))
    for x, count in ((6, 4), (60, 1)):
        rows = np.column_stack([x + along.ravel(), np.zeros(32), z.ravel()])
        foot = np.array([[x + step, 1.0, -1.5] for step in (0, 1, 2)])
        found = propose(as_scan(np.concatenate([rows, foot])), CALIBRATION, SIZE)
        assert len(found) == count


def test_a_long_cluster_is_cut_where_it_is_thin():
    rules = ProposalConfig(radius_m=0.5)
    # Two cars nose to tail, 0.4 m apart: together longer than a car, so that half the radius rules.
    cars = [upright(8, (-4.2, -1.5), (-0.2, 0), 2000), upright(8, (0.2, -1.5), (4.2, 0), 2000)]
    assert len(propose(scene(*cars), CALIBRATION, SIZE, rules)) == 2
    # Alone, the same gap within 3 m parts nothing.
    halves = [upright(8, (-1.5, -1.5), (-0.2, 0), 800), upright(8, (0.2, -1.5), (1.5, 0), 800)]
    assert len(propose(scene(*halves), CALIBRATION, SIZE, rules)) == 1


def test_thesis_equals_loops_over_points():
    generator = np.random.default_rng(4)
    objects = [
        upright(x, (y, -1.5), (y + 1.5, z), 60, generator)
        for x, y, z in generator.uniform((6, -6, -1), (40, 6, 1), (12, 3))
    ]
    # The outlier is too rare for the distribution of the others.
    scan = scene(*objects, [[75, 70, 90]], [[-9, 0, 0]])[::2]
    for rules in (ProposalConfig(), ProposalConfig(0.3, 0.05, 2, 0.8)):
        found = propose(scan, CALIBRATION, SIZE, rules, "thesis")
        expected = boxes_by_loop(scan, CALIBRATION, SIZE, rules)
        assert found.boxes_px.tolist() == expected.tolist()
        assert len(found) > 5


def test_steps_can_be_called_apart():
    scan, rules = scene(upright(10, (2, -1.5), (4, 0))), ProposalConfig()
    for method in METHODS:
        above_ground = find_above_ground(
            scan, CALIBRATION, SIZE, rules.cell_m, rules.min_variance_m2, method
        )
        labels = cluster_points(above_ground, rules.radius_m, rules.min_points, method)
        apart, whole = (
            fit_boxes(above_ground, labels),
            propose(scan, CALIBRATION, SIZE, rules, method),
        )
        assert apart.boxes_px.tolist() == whole.boxes_px.tolist()
        assert apart.clusters.tolist() == whole.clusters.tolist()


def test_points_belong_to_the_proposal_of_their_number():
    scan = scene(upright(10, (2, -1.5), (4, 0)), upright(20, (-6, -1.5), (-2, 0)))
    found = propose(scan, CALIBRATION, SIZE)
    for number, (left, _, right, _) in enumerate(found.boxes_px):
        y_m, x_m = scan[found.clusters == number, 1], scan[found.clusters == number, 0]
        columns = np.rint(100 - 100 * y_m / x_m)
        assert (columns.min(), columns.max()) == (left, right)
    second = found[np.array([1])]
    assert (second.clusters >= 0).tolist() == (found.clusters == 1).tolist()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "xyz",
    [
        np.zeros((0, 3)),
        [[-10, 0, 0]] * 30,  # behind the camera
        [[10, 0, 0]],
        [[10, 0, 0]] * 30,  # in one place
        np.column_stack([np.linspace(6, 30, 100), np.zeros(100), np.zeros(100)]),  # level line
        [[200, 0, z] for z in range(30)],  # too far
    ],
    ids=["none", "behind", "one", "place", "line", "far"],
)
def test_scans_without_objects_have_no_proposals(method, xyz):
    scan = as_scan(np.reshape(xyz, (-1, 3)))
    found = propose(scan, CALIBRATION, SIZE, method=method)
    assert len(found) == 0
    assert found.boxes_px.shape == (0, 4)
    assert found.clusters.tolist() == [-1] * len(scan)


@pytest.mark.parametrize("method", METHODS)
def test_all_points_in_one_cell_are_one_proposal(method):
    pole = [[10.1, 0.1, z] for z in np.linspace(-1.5, 0, 20)]
    found = propose(as_scan(np.array(pole)), CALIBRATION, SIZE, method=method)
    assert found.boxes_px.tolist() == [[99, 45, 99, 65]]


@pytest.mark.parametrize("method", METHODS)
def test_an_image_of_one_pixel_has_boxes_of_that_pixel(method):
    single = Calibration(np.eye(3, 4), CALIBRATION.cam_SE3_velo)
    found = propose(scene(upright(10, (-1, -1.5), (1, 0))), single, (1, 1), method=method)
    assert found.boxes_px.tolist() == [[0, 0, 0, 0]]


@pytest.mark.parametrize("method", METHODS)
def test_sixteen_beams_are_enough(method):
    found = propose(sixteen_beams(), CALIBRATION, SIZE, method=method)
    assert len(found) == 1
    # Of the wall, which beams two degrees apart hit: v = 50 - 100 tan.
    assert found.boxes_px[0, [0, 2]] == pytest.approx([90, 110], abs=2)
    assert found.boxes_px[0, 3] == pytest.approx(62, abs=1)
    assert found.depths_m == pytest.approx([12], abs=0.3)


def sixteen_beams():
    """Return what a VLP-16 sees of level ground and of a wall 12 m ahead, 2.4 m wide and 1.4 m high."""
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-30, 30, 0.2)), VLP_16.elevations_rad)
    slope = np.tan(elevation)
    with np.errstate(divide="ignore"):
        to_ground_m = np.where(slope < 0, -1.5 / slope, np.inf)
    to_wall_m = 12 / np.cos(azimuth)
    is_wall = (np.abs(12 * np.tan(azimuth)) <= 1.2) & (to_wall_m * slope <= -0.1)
    distance_m = np.where(is_wall, np.minimum(to_wall_m, to_ground_m), to_ground_m)
    xyz = distance_m[..., None] * np.stack([np.cos(azimuth), np.sin(azimuth), slope], axis=-1)
    return as_scan(xyz[distance_m < 80])


@pytest.mark.parametrize(("method", "least"), [("default", 0.85), ("thesis", 0.7)])
def test_cars_of_real_frames_are_found(kitti_root: Path, method, least):
    drive = open_drive(kitti_root / "tracking", sequence="0000", images=False)
    best = []
    for index in range(0, len(drive), 8):
        frame, labels = drive[index], drive.labels(index)
        found = propose(frame.points_velo, frame.calibration, (1242, 375), method=method)
        _is_well_formed(found, (1242, 375))
        shows = (labels.types == "Car") & (labels.occlusion <= 1) & (labels.truncation < 1)
        height_px = labels.boxes_px[:, 3] - labels.boxes_px[:, 1]
        cars = labels[shows & (height_px >= 25)]
        best.extend(iou_px(cars.boxes_px, found.boxes_px).max(axis=1))
    assert len(best) > 10
    assert np.mean(np.array(best) >= 0.5) >= least


def _is_well_formed(found: Proposals, size_px):
    assert np.isfinite(found.boxes_px).all()
    assert (found.boxes_px >= 0).all()
    assert (found.boxes_px[:, [0, 2]] < size_px[0]).all()
    assert (found.boxes_px[:, [1, 3]] < size_px[1]).all()
    assert (found.boxes_px[:, 2:] >= found.boxes_px[:, :2]).all()
    assert (found.depths_m > 0).all()
    assert sorted(set(found.clusters.tolist()) - {-1}) == list(range(len(found)))
