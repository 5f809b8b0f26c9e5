"""Whatever a scan holds, every stage gives a result, or the scan is refused in one sentence."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from data.beam_pattern import beam_anomalies
from perception.detection.config import DetectionConfig
from perception.detection.depthcn.proposals import propose
from perception.errors import MountingError, PerceptionError, ScanError
from perception.localization.mounting import check_mounting
from perception.maps.densify import FILL_METHODS, densify
from perception.maps.encoding import encode_depth, encode_reflectance
from perception.maps.projection import camera_of, project_frame
from perception.pipeline import Pipeline, PipelineConfig
from perception.sensor import VLP_16
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Frame
from tests.damaged_scans import CAR, DAMAGES, REFUSED, frame_of
from tests.faults import fault

pytestmark = pytest.mark.filterwarnings("error")

USED = [name for name in DAMAGES if name not in REFUSED]
NO_DETECTION = DetectionConfig(modalities=())


def _run_pipeline(frame: Frame, config: PipelineConfig) -> None:
    """Run a clean frame before and after, and the frame as the first one of a drive."""
    with Pipeline(VLP_16, config) as pipeline:
        for one in (frame_of(0), frame, frame_of(2)):
            result = pipeline.step(one)
            assert len(result.obstacles.point_states) == len(one.points_velo)
            assert np.isfinite(result.world_SE3_velo).all()
            assert np.isfinite(result.ground.height_m(np.zeros((1, 2)))).all()
        pipeline.reset()
        try:
            pipeline.step(frame)
        except MountingError as error:
            assert error.found


def _default(frame: Frame) -> None:
    _run_pipeline(frame, PipelineConfig(parallel=False, detection=NO_DETECTION))


def _thesis(frame: Frame) -> None:
    _run_pipeline(frame, PipelineConfig(method="thesis", parallel=False, detection=NO_DETECTION))


def _maps(frame: Frame) -> None:
    sparse = project_frame(frame)
    assert encode_depth(sparse.depth_m).shape == sparse.depth_m.shape
    for method in FILL_METHODS:
        dense = densify(sparse, method)
        assert np.isfinite(dense.depth_m).all()
        assert encode_reflectance(dense.reflectance).shape == dense.depth_m.shape


def _proposals(frame: Frame) -> None:
    for method in ("default", "thesis"):
        found = propose(frame.points_velo, *camera_of(frame), method=method)
        assert np.isfinite(found.boxes_px).all()


def _single_object(frame: Frame) -> None:
    with Pipeline(VLP_16, PipelineConfig(parallel=False, detection=NO_DETECTION)) as pipeline:
        inputs = [
            tracker_input_of(pipeline.step(one), pipeline.config.ego_vehicle)
            for one in (frame_of(0), frame, frame_of(2))
        ]
    for name in ("default", "h-fus", "3d-ms", "3d-kf"):
        tracker = single_object_tracker(name, VLP_16)
        tracker.init(inputs[0], CAR)
        for one in inputs[1:]:
            box_velo = tracker.update(one).box_velo
            assert box_velo is not None and np.isfinite(box_velo.bottom_m).all()


def _setup(frame: Frame) -> None:
    list(beam_anomalies(frame, VLP_16))
    try:
        check_mounting(frame.points_velo, VLP_16)
    except PerceptionError as error:
        assert error.found


@pytest.mark.parametrize("stage", [_default, _thesis, _maps, _proposals, _single_object, _setup])
@pytest.mark.parametrize("damage", USED)
def test_every_stage_has_a_result(damage: str, stage: Callable[[Frame], None]):
    stage(frame_of(1, damage))


def test_detectors_take_every_scan(all_stages):
    with Pipeline(VLP_16, replace(all_stages, parallel=False)) as pipeline:
        results = [pipeline.step(frame_of(row, damage)) for row, damage in enumerate(USED)]
    assert all(result.vehicles is not None for result in results)


@pytest.mark.parametrize("damage", REFUSED)
def test_what_holds_no_measurement_is_refused(damage):
    with fault(ScanError, where="frame"):
        frame_of(1, damage)


@pytest.mark.parametrize("damage", ["NaN points", "NaN reflectance", "infinite", "huge"])
def test_points_without_a_return_are_outside(damage):
    frame = frame_of(1, damage)
    is_invalid = ~frame.points_velo[:, :3].any(axis=1)
    assert is_invalid.sum() == frame.invalid_points == len(frame.points_velo) // 3
    with Pipeline(VLP_16, PipelineConfig(parallel=False, detection=NO_DETECTION)) as pipeline:
        states = pipeline.step(frame).obstacles.point_states
    assert not states[is_invalid].any()
    assert states[~is_invalid].any()
