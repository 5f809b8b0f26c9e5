"""Vehicles to rows of KITTI's object and tracking benchmarks, by the formats' rules, and back through our readers."""

import numpy as np
import pytest

from data.kitti.detection_rows import read_detection_set
from data.kitti.labels import read_object_labels
from data.kitti.tracking_rows import format_result_rows, read_result_rows
from data.results.vehicles import format_object_rows, to_vehicle_rows
from perception.types import Boxes3D, Calibration, Detections, FusedDetections, Vehicles

CALIBRATION = Calibration(
    image_P_cam=np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0, -1, 0, 0.0], [0, 0, -1, 0.08], [1, 0, 0, -0.27], [0, 0, 0, 1]]),
)


@pytest.fixture
def vehicles():
    """A car ahead that is followed, and one of which there is nothing but a box in the image."""
    nan = np.nan
    return Vehicles(
        fused=FusedDetections(
            Detections(
                np.array([[500.0, 150, 620.25, 240], [10, 160, 60, 200]]),
                np.array([0.875, 0.25]),
                np.array(["Car", "Car"]),
            ),
            source_indices=np.array([[0, 0, -1], [1, -1, -1]]),
            dominant_modality=np.array([0, 0]),
        ),
        ids=np.array([7, -1]),
        boxes=Boxes3D(
            np.array([[20.27, 2.0, -1.7], [nan] * 3]),
            np.array([[4.2, 1.8, 1.5], [nan] * 3]),
            np.array([0.0, nan]),
        ),
        distances_m=np.array([18.0, nan]),
        velocities_m_s=np.array([[3.0, 0], [nan, nan]]),
        covariances=np.full((2, 4, 4), nan),
        owners=np.full(5, -1),
    )


def test_rows_are_what_the_benchmarks_server_takes(vehicles):
    rows = format_object_rows(vehicles, CALIBRATION).splitlines()
    first, second = (row.split() for row in rows)
    assert len(first) == len(second) == 16
    assert (first[:3], second[:3]) == (["Car", "-1", "-1"], ["Car", "-1", "-1"])
    # Seen from behind: heading ry is -90 degrees, alpha the same less the way to where it stands.
    expected = [
        *(np.arctan2(2.0, 20.27) - np.pi / 2, 500, 150, 620.25, 240),
        *(1.5, 1.8, 4.2, -2.0, 1.78, 20.0, -np.pi / 2, 0.875),
    ]
    np.testing.assert_allclose([float(word) for word in first[3:]], expected, atol=1e-6)
    unknown = [-10, 10, 160, 60, 200, -1, -1, -1, -1000, -1000, -1000, -10, 0.25]
    assert [float(word) for word in second[3:]] == unknown


def test_our_own_evaluator_reads_what_was_written(vehicles, tmp_path):
    text = format_object_rows(vehicles, CALIBRATION)
    label = "Car 0.00 0 -1.57 500 150 620.25 240 1.5 1.8 4.2 -2.0 1.78 20.0 -1.57\n"
    for folder, content in (("results/data", text), ("label_2", label)):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "000000.txt").write_text(content)
    read = read_detection_set(tmp_path / "results", tmp_path / "label_2").detections
    np.testing.assert_array_equal(read.boxes_px, vehicles.fused.detections.boxes_px)
    assert read.scores.tolist() == [0.875, 0.25]
    assert read.alphas_rad[1] == -10


def test_boxes_read_back_in_the_lidar_frame(vehicles, tmp_path):
    path = tmp_path / "000000.txt"
    path.write_text(format_object_rows(vehicles, CALIBRATION))
    read = read_object_labels(path, CALIBRATION).boxes_velo
    np.testing.assert_allclose(read.bottom_m[0], [20.27, 2.0, -1.7], atol=2e-6)
    np.testing.assert_allclose(read.size_m[0], [4.2, 1.8, 1.5], atol=1e-6)
    np.testing.assert_allclose(read.yaw_rad[0], 0.0, atol=1e-6)


def test_only_followed_vehicles_are_rows_of_the_tracking_benchmark(vehicles, tmp_path):
    path = tmp_path / "0000.txt"
    path.write_text(format_result_rows(to_vehicle_rows(3, vehicles, CALIBRATION)))
    rows = read_result_rows(path, 4)
    assert (rows.frames.tolist(), rows.ids.tolist(), rows.scores.tolist()) == ([3], [7], [0.875])


def test_unlikely_vehicles_can_be_left_out(vehicles):
    assert len(to_vehicle_rows(3, vehicles, CALIBRATION, min_score=0.9)) == 0
