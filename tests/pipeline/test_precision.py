"""Arrays of 64 bits and of 32 bits lead to the same results, from a drive, and from stages that take both."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.datmo.point_detector import cluster_moving_points
from perception.obstacles.ground_planes import PiecewisePlanesEstimator
from perception.obstacles.voxels import count_voxels
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16

FRAMES = 6
LIDAR_ALONE = PipelineConfig.for_motion()


@pytest.fixture(scope="module")
def frames():
    return list(SyntheticDrive(FRAMES, sensor=VLP_16, images=False))


def results_of(frames):
    pipeline = Pipeline(VLP_16, LIDAR_ALONE)
    return [pipeline.step(frame) for frame in frames]


@pytest.mark.parametrize(
    "convert",
    [
        lambda scan: scan.astype(np.float64),
        np.asfortranarray,
        lambda scan: np.repeat(scan, 2, 0)[::2],
    ],
    ids=["float64", "by columns", "every second row"],
)
def test_a_scan_of_another_type_or_order_is_converted_once(frames, convert):
    frame = replace(frames[0], points_velo=convert(frames[0].points_velo))
    assert frame.points_velo.dtype == np.float32
    assert frame.points_velo.flags.c_contiguous
    np.testing.assert_array_equal(frame.points_velo, frames[0].points_velo)
    assert replace(frame).points_velo is frame.points_velo


def test_a_coordinate_beyond_float32_is_no_measurement(frames):
    scan = frames[0].points_velo.astype(np.float64)
    scan[7, 0] = 1e300
    frame = replace(frames[0], points_velo=scan)
    assert frame.invalid_points == frames[0].invalid_points + 1
    assert frame.points_velo[7].tolist() == [0, 0, 0, 0]


def test_poses_of_32_bits_move_results_by_less_than_a_millimetre(frames):
    """A pose of 32 bits is off by 4 micrometres at 100 m."""
    rounded = [replace(one, world_SE3_velo=one.world_SE3_velo.astype(np.float32)) for one in frames]
    assert rounded[0].world_SE3_velo.dtype == np.float64
    xy_m = np.array([[5.0, 0], [15, 2], [25, -3]])
    for found, expected in zip(results_of(rounded), results_of(frames), strict=True):
        np.testing.assert_allclose(found.world_SE3_velo, expected.world_SE3_velo, atol=1e-3)
        heights_m = found.ground.height_m(xy_m)
        np.testing.assert_allclose(heights_m, expected.ground.height_m(xy_m), atol=1e-3)
        differing = found.obstacles.point_states != expected.obstacles.point_states
        assert np.count_nonzero(differing) <= 3  # on the edge of a threshold
        assert found.tracks.ids.tolist() == expected.tracks.ids.tolist()
        for name in ("bottom_m", "size_m"):
            boxes = (getattr(one.tracks.boxes, name) for one in (found, expected))
            np.testing.assert_allclose(*boxes, atol=1e-3)
        velocities_m_s = (one.tracks.velocities_m_s for one in (found, expected))
        np.testing.assert_allclose(*velocities_m_s, atol=1e-2)


def test_ground_planes_take_both(frames):
    scan = frames[0].points_velo
    planes = [
        PiecewisePlanesEstimator(VLP_16).estimate(one, np.random.default_rng(0))
        for one in (scan, scan.astype(np.float64))
    ]
    distances_m = [one.distance_m(scan[:, :3].astype(np.float64)) for one in planes]
    np.testing.assert_allclose(*distances_m, atol=1e-6)


def test_voxels_take_both(frames):
    scan = frames[0].points_velo[:, :3]
    single, double = count_voxels(scan, 0.2), count_voxels(scan.astype(np.float64), 0.2)
    assert single.counts.tolist() == double.counts.tolist()
    np.testing.assert_allclose(single.centers_m, double.centers_m, atol=1e-4)


def test_clusters_take_both(frames):
    scan = frames[0].points_velo[::5]
    clusters = [
        cluster_moving_points(one, VLP_16.elevation_step_rad)
        for one in (scan, scan.astype(np.float64))
    ]
    np.testing.assert_array_equal(*clusters)
    assert clusters[0].max() > 2
