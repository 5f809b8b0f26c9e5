"""Several cameras in the pipeline: detectors run in each, and a dark one does not stop the others."""

from dataclasses import replace

import numpy as np
import pytest

from perception.geometry import se3
from perception.pipeline import Pipeline
from perception.types import MODALITIES, CameraImage
from tests.pipeline.conftest import blotches


@pytest.fixture(scope="module")
def frames(street_frames):
    """Return frames with a second camera that looks to the left, without an image in the last frame."""
    last = street_frames[-1].index
    return [
        replace(
            frame,
            further_cameras=(
                CameraImage(
                    "left",
                    replace(
                        frame.calibration,
                        cam_SE3_velo=frame.calibration.cam_SE3_velo
                        @ se3.inverse(se3.from_euler(0.0, 0.0, np.radians(60))),
                    ),
                    None if frame.index == last else blotches(frame)[:, ::-1].copy(),
                ),
            ),
        )
        for frame in street_frames
    ]


def test_every_camera_detects_and_the_main_one_as_it_does_alone(
    frames, street_frames, stages_in_turn
):
    with Pipeline(config=stages_in_turn) as alone, Pipeline(config=stages_in_turn) as both:
        for frame, single in zip(frames, street_frames, strict=True):
            result, expected = both.step(frame), alone.step(single)
            for modality in MODALITIES:
                found, main = result.modality_detections, expected.modality_detections
                np.testing.assert_array_equal(found[modality].boxes_px, main[modality].boxes_px)
            (left,) = result.further_detections
            is_dark = frame.further_cameras[0].image is None
            assert set(left) == set(MODALITIES) - ({"rgb"} if is_dark else set())
            assert result.detections_in(1) is left
            assert expected.further_detections == ()
            assert {-1, 0, 1} >= set(result.vehicles.cameras.tolist())
            assert (result.vehicles.cameras == 1).any()
            assert {-1, 0} >= set(expected.vehicles.cameras.tolist())
            np.testing.assert_array_equal(
                result.obstacles.point_states, expected.obstacles.point_states
            )


def test_the_time_of_a_stage_is_that_of_all_cameras(frames, stages_in_turn):
    with Pipeline(config=stages_in_turn) as pipeline:
        result = pipeline.step(frames[0])
    spans = [span for span in result.spans if span.stage == "maps"]
    assert len(spans) == 2
    assert result.timings_s["maps"] == sum(span.stop_s - span.start_s for span in spans)
