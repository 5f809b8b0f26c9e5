"""The same drive in KITTI's layout and in those of other data sets."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from data.derived.moving_truth import moving_truth
from data.detections.measured_drives import drive_kind
from data.inspection import inspect_drive
from data.open_drive import open_drive, sequences_in
from data.recorded_drive import RecordedDrive
from perception.evaluation.ground import GROUND_CLASSES
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16
from perception.types import Result
from tests.other_layouts import FRAMES, GridDrive, grid_drive, write_all

NAMES = ("Argoverse 2", "nuScenes", "SemanticKITTI")
SEQUENCES = {"nuScenes": "scene-0061"}


@pytest.fixture(scope="module")
def exact() -> GridDrive:
    return grid_drive()


@pytest.fixture(scope="module")
def roots(make_once: Callable[[str, Callable[[Path], object]], Path]) -> dict[str, Path]:
    """Return the folder of each layout."""
    base = make_once("other_layouts", write_all)
    return {name: base / name for name in ("KITTI", *NAMES)}


@pytest.fixture(scope="module")
def opened(roots: dict[str, Path]) -> Callable[..., RecordedDrive]:
    """Return a function that opens the drive in a layout."""
    sensor = str(roots["KITTI"] / "training" / "sensor.json")

    def open_it(name: str, *, images: bool = True) -> RecordedDrive:
        return open_drive(roots[name], sequence=SEQUENCES.get(name), sensor=sensor, images=images)

    return open_it


@pytest.fixture(scope="module")
def kitti_results(opened: Callable[..., RecordedDrive]) -> list[Result]:
    return results_of(opened("KITTI"))


def results_of(drive: RecordedDrive) -> list[Result]:
    """Return the results of all frames, without images."""
    with Pipeline(drive.sensor, PipelineConfig.for_motion()) as pipeline:
        return [pipeline.step(replace(frame, image=None, calibration=None)) for frame in drive]


@pytest.mark.parametrize("name", NAMES)
def test_points_and_poses_are_those_of_kitti(name, exact, opened):
    drive, kitti = opened(name), opened("KITTI")
    assert (len(drive), drive.is_sequence, drive.has_poses) == (FRAMES, True, True)
    origin = np.linalg.inv(drive.world_SE3_velo(0))
    kitti_origin = np.linalg.inv(kitti.world_SE3_velo(0))
    for index in range(FRAMES):
        frame = drive[index]
        np.testing.assert_array_equal(frame.points_velo, exact.scan(index).points_velo)
        assert frame.stamp_s - drive.stamp_s(0) == pytest.approx(0.1 * index, abs=1e-9)
        # KITTI's text has 13 digits of a degree, less than a micrometre.
        np.testing.assert_allclose(
            origin @ frame.world_SE3_velo, kitti_origin @ kitti.world_SE3_velo(index), atol=1e-6
        )


@pytest.mark.parametrize("name", NAMES)
def test_results_are_those_of_kitti(name, opened, kitti_results):
    """Points, ground and motion are the same; poses of other formats differ by their last digits."""
    for result, expected in zip(results_of(opened(name, images=False)), kitti_results, strict=True):
        states, known = result.obstacles.point_states, expected.obstacles.point_states
        assert np.count_nonzero(states != known) == 0
        np.testing.assert_allclose(
            result.ground.height_m(result.frame.points_velo[::50]),
            expected.ground.height_m(expected.frame.points_velo[::50]),
            atol=1e-5,
        )
        np.testing.assert_array_equal(result.tracks.ids, expected.tracks.ids)
        np.testing.assert_allclose(
            result.tracks.boxes.bottom_m, expected.tracks.boxes.bottom_m, atol=1e-4
        )


@pytest.mark.parametrize("name", NAMES)
def test_the_camera_is_that_of_kitti(name, exact, opened):
    drive = opened(name)
    assert drive.has_images
    assert [frame.image.shape for frame in drive] == [(375, 1242, 3)] * FRAMES
    assert drive.calibration.image_size_px == exact.calibration.image_size_px
    points = exact.scan(0).points_velo[exact.scan(0).points_velo[:, 0] > 5][::100, :3]
    ahead = np.column_stack([points, np.ones(len(points))])
    pixels, known = (
        camera.image_P_velo @ ahead.T for camera in (drive.calibration, exact.calibration)
    )
    # The other sets have no fourth column of the projection: 6 cm of baseline, and less than a pixel of shift.
    tolerance_px = 0.01 if name == "SemanticKITTI" else 12
    np.testing.assert_allclose(pixels[:2] / pixels[2], known[:2] / known[2], atol=tolerance_px)


@pytest.mark.parametrize("name", ["Argoverse 2", "nuScenes"])
def test_labels_of_key_frames_are_the_exact_boxes(name, exact, opened):
    drive = opened(name, images=False)
    labels, known = drive.labels_around(2), exact.labels_around(2)
    order = np.argsort(labels.track_ids)
    assert len(labels) == len(known) > 10
    np.testing.assert_allclose(
        labels.boxes_velo.bottom_m[order], known.boxes_velo.bottom_m, atol=1e-9
    )
    np.testing.assert_allclose(labels.boxes_velo.size_m[order], known.boxes_velo.size_m, atol=1e-9)
    # Boxes of the labels are upright along the axes of the LiDAR, which is tilted by fractions of a degree.
    turns = np.angle(np.exp(1j * (labels.boxes_velo.yaw_rad[order] - known.boxes_velo.yaw_rad)))
    np.testing.assert_allclose(turns, 0, atol=1e-3)


@pytest.mark.parametrize("name", ["Argoverse 2", "nuScenes"])
def test_labels_in_the_view_have_boxes_in_the_image(name, opened):
    drive = opened(name, images=False)
    labels = drive.labels(0)
    assert 0 < len(labels) < len(drive.labels_around(0))
    low, high = labels.boxes_px[:, :2], labels.boxes_px[:, 2:]
    assert (low >= 0).all() and (high > low).all() and (high < (1242, 375)).all()
    assert ((labels.truncation >= 0) & (labels.truncation <= 1)).all()


def test_argoverse_states_ground_and_motion_of_points(exact, opened):
    truth, known = opened("Argoverse 2").point_truth(1), exact.point_truth(1)
    np.testing.assert_array_equal(truth.is_moving, known.is_moving)
    is_ground = np.isin(known.classes, GROUND_CLASSES) & (known.instances == 0)
    np.testing.assert_array_equal(truth.classes == 49, is_ground)


def test_semantic_kitti_states_classes_and_motion_of_points(exact, opened):
    truth, known = opened("SemanticKITTI").point_truth(1), exact.point_truth(1)
    np.testing.assert_array_equal(truth.is_moving, known.is_moving)
    np.testing.assert_array_equal(truth.classes, known.classes)
    np.testing.assert_array_equal(truth.instances > 0, known.instances > 0)


def test_argoverse_beams_are_measured(roots):
    sensor = open_drive(roots["Argoverse 2"], images=False).sensor
    nearest = np.abs(sensor.elevations_rad[:, None] - VLP_16.elevations_rad).min(axis=1)
    assert sensor.beams >= 14  # the highest of this drive meet nothing but sky
    assert np.degrees(nearest).max() < 0.3


def test_nuscenes_states_ground_of_key_frames(exact, opened):
    drive = opened("nuScenes")
    truth, known = drive.point_truth(2), exact.point_truth(2)
    is_ground = np.isin(known.classes, GROUND_CLASSES)
    np.testing.assert_array_equal(np.isin(truth.classes, GROUND_CLASSES), is_ground)
    # Points of vehicles count as moving where they are within the box of the object.
    assert (truth.is_moving & known.is_moving).sum() > 0.9 * known.is_moving.sum() > 0
    assert not (truth.is_moving & ~known.is_moving & (truth.classes > 0)).any()
    assert [drive.point_truth(index) is None for index in range(FRAMES)] == [
        False,
        True,
        False,
        True,
    ]


def test_motion_of_labels_is_that_of_exact_truth(opened):
    truth = moving_truth(opened("Argoverse 2", images=False), "all")
    exact = moving_truth(opened("KITTI"), "all")
    # A log numbers its tracks from 0 in the order of their names.
    numbers = np.unique(np.concatenate([frame.labels.track_ids for frame in exact.posed]))
    moving = np.searchsorted(numbers, exact.motion.moving_tracks())
    assert len(moving) > 0
    assert truth.motion.moving_tracks() == moving.tolist()


def test_nuscenes_tells_the_motion_between_key_frames(opened):
    truth = moving_truth(opened("nuScenes", images=False), "all")
    assert [len(posed.labels) > 0 for posed in truth.posed] == [True, True, True, False]


@pytest.mark.parametrize("name", ["KITTI", *NAMES])
def test_check_finds_no_fault(name, opened):
    report = inspect_drive(opened(name))
    assert [one.first_example for one in report.findings if one.is_fault] == []


@pytest.mark.parametrize("name", NAMES)
def test_a_part_of_a_drive_keeps_numbers_names_and_contents(name, opened):
    drive = opened(name)
    part = drive.select([1, 3])
    assert part.frame_numbers == (1, 3)
    assert part.frame_names == (drive.frame_names[1], drive.frame_names[3])
    assert part[1].stamp_s == drive[3].stamp_s
    assert part.fingerprint(0) == drive.fingerprint(1) != drive.fingerprint(2)
    np.testing.assert_array_equal(part[1].world_SE3_velo, drive[3].world_SE3_velo)
    assert part[0].image is not None


def test_sequences_of_each_layout(roots):
    assert sequences_in(roots["nuScenes"]) == ["scene-0061", "scene-0103"]
    assert sequences_in(roots["nuScenes"] / "v1.0-mini") == ["scene-0061", "scene-0103"]
    assert sequences_in(roots["SemanticKITTI"]) == ["08"]
    assert sequences_in(roots["SemanticKITTI"] / "dataset") == ["08"]
    assert sequences_in(roots["SemanticKITTI"] / "dataset/sequences/08") == [None]
    (log,) = sequences_in(roots["Argoverse 2"])
    assert sequences_in(roots["Argoverse 2"] / log) == [None]


def test_real_drives_with_classes_of_points_are_not_called_synthetic(exact, opened):
    kinds = {name: drive_kind(opened(name, images=False)) for name in ("KITTI", *NAMES)}
    assert kinds == {"KITTI": "synthetic", **dict.fromkeys(NAMES, "real")}
