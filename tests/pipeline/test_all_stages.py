"""All stages together: the same answer in every way of running them, and what a missing camera changes."""

import threading
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from perception.detection.bev.detector import BevDetector
from perception.detection.config import NO_DETECTION, DepthCnConfig, DetectionConfig
from perception.detection.depthcn import detector as depthcn_detector
from perception.detection.depthcn.detector import DepthCn
from perception.detection.detectors import modalities
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import ModelError, PoseError
from perception.geometry.grids import LocalArea
from perception.maps.densify import densify
from perception.maps.projection import VIRTUAL_CAMERA
from perception.obstacles.motion_segmentation import FreeSpaceSegmenter
from perception.pipeline import Pipeline, PipelineConfig, camera_stages
from perception.pipeline.lidar_stages import LidarStages
from perception.types import MODALITIES

STAGES = {
    *("scan health", "image health", "calibration"),
    *("registration", "ground", "voxels", "static and moving", "moving objects", "DepthCN"),
    *("maps", "rgb detector", "dm detector", "rm detector", "bev detector", "fusion"),
    *("vehicle location", "vehicles"),
}


def comparable(value):
    """Turn a result into nested lists of arrays and numbers, without what a clock said."""
    if is_dataclass(value):
        names = [field.name for field in fields(value)]
        return [
            comparable(getattr(value, name)) for name in names if name not in ("timings_s", "spans")
        ]
    if isinstance(value, dict):
        return [[key, comparable(item)] for key, item in value.items()]
    return value


def assert_same(one, other):
    if isinstance(one, list):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_same(a, b)
    elif isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, str | int | float | None):
        assert one == other


def test_one_after_another_side_by_side_and_as_a_stream_all_say_the_same(street_frames, all_stages):
    with Pipeline(config=replace(all_stages, parallel=False)) as in_turn:
        expected = [in_turn.step(frame) for frame in street_frames]
    assert sum(len(found) for found in expected[-1].modality_detections.values()) > 0
    assert len(expected[-1].vehicles) > 0
    with Pipeline(config=all_stages) as pipeline:
        step_decay = [pipeline.step(frame) for frame in street_frames]
        pipeline.reset()
        with pipeline.stream(street_frames) as stream:
            streamed = list(stream)
    for results in (step_decay, streamed):
        for one, other in zip(results, expected, strict=True):
            assert_same(comparable(one), comparable(other))


def test_every_stage_is_timed_on_its_worker(street_frames, all_stages):
    with Pipeline(config=all_stages) as pipeline:
        result = pipeline.step(street_frames[0])
    assert set(result.timings_s) == STAGES == {span.stage for span in result.spans}
    assert [span.stage for span in result.spans if span.worker == "vehicles"] == [
        *("image health", "maps", "DepthCN", "fusion"),
        *("vehicle location", "calibration", "vehicles"),
    ]
    workers = {span.worker for span in result.spans}
    assert {"obstacles", "vehicles"} < workers
    for worker in workers:
        of_it = [span for span in result.spans if span.worker == worker]
        edges = [edge for span in of_it for edge in (span.start_s, span.stop_s)]
        assert edges == sorted(edges)
        assert edges[0] >= 0
    assert result.latency_s == max(span.stop_s for span in result.spans)
    times = {span.stage: span for span in result.spans}
    assert times["vehicles"].start_s >= times["moving objects"].stop_s
    for modality in MODALITIES:
        assert times["fusion"].start_s >= times[f"{modality} detector"].stop_s


def hold(monkeypatch, later, earlier):
    """Hold a function until another has returned; return a list that tells of each call whether that came in time.

    Functions are given as the object that has them and their name.
    """
    has_returned, waited = threading.Event(), []
    first, second = getattr(*earlier), getattr(*later)

    def signal_after(*given, **named):
        result = first(*given, **named)
        has_returned.set()
        return result

    def wait_before(*given, **named):
        waited.append(has_returned.wait(timeout=20))
        return second(*given, **named)

    monkeypatch.setattr(*earlier, signal_after)
    monkeypatch.setattr(*later, wait_before)
    return waited


def test_detectors_do_not_wait_for_obstacles(street_frames, all_stages, monkeypatch):
    waited = hold(monkeypatch, (LidarStages, "step"), (DepthCn, "verify_frame"))
    with Pipeline(config=all_stages) as pipeline:
        result = pipeline.step(street_frames[0])
    assert waited == [True]
    assert result.depthcn is not None


def test_vehicles_are_located_while_obstacles_are_segmented(street_frames, all_stages, monkeypatch):
    waited = hold(monkeypatch, (FreeSpaceSegmenter, "voxelize"), (camera_stages, "locate"))
    with Pipeline(config=all_stages) as pipeline:
        pipeline.step(street_frames[0])
    assert waited == [True]


def test_depthcn_runs_while_the_networks_of_images_and_maps_run(
    street_frames, stages_in_turn, monkeypatch
):
    waited = hold(monkeypatch, (ModalityDetector, "detect"), (DepthCn, "verify_frame"))
    with Pipeline(config=stages_in_turn) as pipeline:
        pipeline.step(street_frames[0])
    assert waited == [True] * len(MODALITIES)


def test_maps_are_made_once_for_all_detectors(street_frames, stages_in_turn, monkeypatch):
    made = []

    def count(*given):
        made.append(densify(*given))
        return made[-1]

    for module in (camera_stages, depthcn_detector, modalities):
        monkeypatch.setattr(module, "densify", count)
    with Pipeline(config=stages_in_turn) as pipeline:
        result = pipeline.step(street_frames[0])
    assert result.depthcn is not None
    assert set(result.modality_detections) == set(MODALITIES)
    assert len(made) == 1


def test_the_view_from_above_finds_vehicles_all_round_without_a_camera(
    street_frames, stages_in_turn
):
    detection = replace(
        stages_in_turn.detection, modalities=("bev",), depthcn=DepthCnConfig(enabled=False)
    )
    above = replace(stages_in_turn, detection=detection)
    with Pipeline(config=above) as pipeline:
        results = [
            pipeline.step(replace(frame, image=None, calibration=None)) for frame in street_frames
        ]
    vehicles = results[-1].vehicles
    assert results[-1].modality_detections == {}
    assert set(vehicles.cameras.tolist()) == {-1}
    assert (vehicles.ids >= 0).any()
    bearings_rad = np.arctan2(vehicles.boxes.bottom_m[:, 1], vehicles.boxes.bottom_m[:, 0])
    assert (np.abs(bearings_rad) > 2.5).any()
    assert (np.abs(bearings_rad) < 0.5).any()
    assert "maps" not in results[-1].timings_s


def test_the_view_from_above_uses_the_ground_of_the_pipeline_where_that_covers_it(
    street_frames, stages_in_turn, monkeypatch
):
    given = []
    detect = BevDetector.detect

    def note(detector, points_velo, ground=None):
        given.append(ground)
        return detect(detector, points_velo, ground)

    monkeypatch.setattr(BevDetector, "detect", note)
    for area in (LocalArea(30.0, 30.0, 30.0), LocalArea(30.0, 10.0, 30.0)):
        with Pipeline(config=replace(stages_in_turn, area=area)) as pipeline:
            given.append(pipeline.step(street_frames[0]).ground)
    assert given[0] is given[1]
    assert given[2] is None


def test_result_holds_the_map_images(street_frames, stages_in_turn):
    frame = street_frames[0]
    with Pipeline(config=stages_in_turn) as pipeline:
        map_images = pipeline.step(frame).map_images
    assert set(map_images) == {"dm", "rm"}
    for modality, image in map_images.items():
        np.testing.assert_array_equal(image, modality_image(frame, modality)[..., 0])


def test_without_an_image_the_lidar_detects_alone(street_frames, stages_in_turn):
    with Pipeline(config=stages_in_turn) as pipeline:
        result = pipeline.step(replace(street_frames[0], image=None))
    assert set(result.modality_detections) == {"dm", "rm"}
    assert result.depthcn is not None


def test_without_poses_vehicles_are_located_all_the_same(street_frames, stages_in_turn):
    # Where nothing says how the LiDAR moved, its scans are registered to each other.
    with Pipeline(config=stages_in_turn) as pipeline:
        with_poses = pipeline.step(street_frames[0]).vehicles
        pipeline.reset()
        frames = [replace(frame, world_SE3_velo=None) for frame in street_frames]
        without = [pipeline.step(frame).vehicles for frame in frames]
    np.testing.assert_allclose(without[0].boxes.bottom_m, with_poses.boxes.bottom_m, atol=1e-9)
    assert all(len(found) > 0 for found in without)


def notes_of(caplog) -> list[tuple]:
    """Return the arguments of all notes of the pipeline."""
    return [one.args for one in caplog.records if one.name.startswith("perception.pipeline")]


@pytest.mark.parametrize(
    ("missing", "named", "camera"),
    [
        (("image",), "camera image", None),
        (("calibration",), "calibration of a camera", VIRTUAL_CAMERA),
        (("image", "calibration"), "calibration of a camera", VIRTUAL_CAMERA),
    ],
)
def test_what_is_missing_of_the_camera_is_noted_once(
    street_frames, stages_in_turn, caplog, missing, named, camera
):
    frames = [replace(frame, **dict.fromkeys(missing)) for frame in street_frames]
    in_images = replace(stages_in_turn.detection, modalities=MODALITIES)
    stages_in_turn = replace(stages_in_turn, detection=in_images)
    with Pipeline(config=stages_in_turn) as pipeline:
        results = [pipeline.step(frame) for frame in frames]
    ((source, what, _),) = notes_of(caplog)
    assert (source, what) == (frames[0].source, named)
    # The maps are those of the camera in its place.
    seen = [replace(one, image=None, calibration=camera or one.calibration) for one in frames]
    with Pipeline(config=stages_in_turn) as pipeline:
        expected = [pipeline.step(frame) for frame in seen]
    for one, other in zip(results, expected, strict=True):
        assert set(one.modality_detections) == {"dm", "rm"}
        assert_same(comparable(replace(one, frame=other.frame)), comparable(other))
    assert any(np.isfinite(one.vehicles.boxes.bottom_m).any() for one in results)


def test_the_image_detector_alone_needs_image_and_calibration(
    street_frames, stages_in_turn, caplog
):
    detection = replace(
        stages_in_turn.detection, modalities=("rgb",), depthcn=DepthCnConfig(enabled=False)
    )
    alone = replace(stages_in_turn, detection=detection)
    for missing in ("image", "calibration"):
        caplog.clear()
        with Pipeline(config=alone) as pipeline:
            results = [pipeline.step(replace(frame, **{missing: None})) for frame in street_frames]
        assert len(notes_of(caplog)) == 1
        assert all(result.vehicles is None for result in results)


def test_without_detectors_no_missing_camera_is_reported(street_frames, caplog):
    with Pipeline(config=PipelineConfig.for_motion()) as pipeline:
        pipeline.step(replace(street_frames[0], image=None, calibration=None))
    assert notes_of(caplog) == []


def test_frames_that_are_no_sequence_are_processed_apart(street_frames, all_stages):
    frame = street_frames[1]
    with Pipeline(config=all_stages) as pipeline:
        alone = pipeline.step(frame)
        with pipeline.stream([street_frames[0], frame], is_sequence=False) as stream:
            _, second = stream
    assert_same(comparable(second), comparable(alone))


def test_an_error_in_the_middle_comes_in_order_and_ends_the_stream(street_frames, all_stages):
    last = street_frames[2]
    pose = last.world_SE3_velo.copy()
    pose[:2, 3] += 8.0
    later = replace(last, index=3, stamp_s=last.stamp_s + 0.1)
    frames = [*street_frames[:2], replace(last, world_SE3_velo=pose), later]
    with Pipeline(config=all_stages) as pipeline, pipeline.stream(frames) as stream:
        assert [next(stream).frame.index, next(stream).frame.index] == [0, 1]
        with pytest.raises(PoseError) as error:
            next(stream)
        assert error.value.found.startswith("a jump of")
        assert list(stream) == []


def test_detectors_that_are_off_are_not_opened(tmp_path):
    nowhere = tmp_path / "nowhere.onnx"
    unused = replace(
        NO_DETECTION, rgb_model=nowhere, depthcn=DepthCnConfig(enabled=False, model=nowhere)
    )
    Pipeline(config=PipelineConfig(detection=unused)).close()
    with pytest.raises(ModelError) as error:
        Pipeline(config=PipelineConfig(detection=DetectionConfig(rgb_model=nowhere)))
    assert error.value.where.endswith("nowhere.onnx")


def child_processes():
    return {
        child
        for file in Path("/proc/self/task").glob("*/children")
        for child in file.read_text().split()
    }


def worker_threads():
    return {thread.name for thread in threading.enumerate()} & {"obstacles_0", "vehicles_0"}


def test_the_workers_are_threads_of_this_process_and_end_with_the_pipeline(
    street_frames, all_stages
):
    processes = child_processes()
    with Pipeline(config=all_stages) as pipeline:
        pipeline.step(street_frames[0])
        assert worker_threads() == {"obstacles_0", "vehicles_0"}
        assert child_processes() == processes
    assert worker_threads() == set()
