"""Known errors of a calibration are found, and scenes that do not determine it are refused."""

from dataclasses import replace

import numpy as np
import pytest

from perception.calibration.frame_edges import FrameEdges
from perception.calibration.recalibration import recalibrate
from perception.errors import CalibrationError
from perception.geometry.se3 import from_motion_vector, inverse, rotation_angle_rad
from perception.sensor import HDL_64E, VLP_16
from tests.board_scenes import CAM_SE3_VELO


def edges_with(frames, rotation_deg, translation_m):
    """Return the edges of frames whose calibration is off."""
    off = from_motion_vector(np.concatenate([np.radians(rotation_deg), translation_m]))
    return [
        FrameEdges.of(
            replace(
                frame,
                calibration=replace(frame.calibration, cam_SE3_velo=off @ CAM_SE3_VELO),
            ),
            HDL_64E,
        )
        for frame in frames
    ]


@pytest.mark.parametrize(
    ("rotation_deg", "translation_m"),
    [
        ((0, 0, 0), (0, 0, 0)),
        ((0, -0.5, 0), (0, 0, 0)),
        ((0, 0, 0.5), (0, 0, 0)),
        ((0, 0, 0), (0.05, -0.05, 0)),
        ((-1.5, 2.0, 1.0), (0.1, 0.05, 0.0)),
    ],
)
def test_a_known_error_is_found(board_frames, rotation_deg, translation_m):
    found = recalibrate(edges_with(board_frames, rotation_deg, translation_m), HDL_64E)
    left = found.cam_SE3_velo @ inverse(CAM_SE3_VELO)
    assert np.degrees(rotation_angle_rad(left)) < 0.15
    assert np.linalg.norm(left[:3, 3]) < 0.04
    assert found.contrast > 0.2


def test_a_result_is_the_same_twice(board_frames):
    first, again = (
        recalibrate(edges_with(board_frames[:3], (0.3, 0.2, 0), (0, 0, 0)), HDL_64E) for _ in "12"
    )
    np.testing.assert_array_equal(first.cam_SE3_velo, again.cam_SE3_velo)
    np.testing.assert_array_equal(first.covariance, again.covariance)


def test_scans_without_edges_are_refused(board_frames):
    wall = np.array([[40.0, y, z, 0.3] for y in np.arange(-9, 9, 0.1) for z in (-1, 0)], np.float32)
    frames = [replace(frame, points_velo=wall) for frame in board_frames]
    with pytest.raises(CalibrationError) as caught:
        recalibrate(edges_with(frames, (0, 0, 0), (0, 0, 0)), HDL_64E, "0000.txt")
    assert str(caught.value) == (
        "0000.txt: expected at least 300 edges of near objects in the scans, to find the calibration, "
        "found 0 in 7 frames; take frames of a street with parked cars, poles or houses"
    )


def test_an_image_of_another_scene_is_refused(board_frames):
    dark = [replace(frame, image=np.full_like(frame.image, 60)) for frame in board_frames]
    with pytest.raises(CalibrationError, match=r"better by 12 % than turned by 1.5 degrees, found"):
        recalibrate(edges_with(dark, (0, 0, 0), (0, 0, 0)), HDL_64E)


def test_beams_that_are_far_apart_do_not_determine_it(board_frames):
    with pytest.raises(CalibrationError, match=r"determine to 0.15 degrees .* found 0\.4"):
        recalibrate(edges_with(board_frames, (0, 0, 0), (0, 0, 0)), VLP_16)


def test_a_frame_without_image_is_refused(board_frames):
    with pytest.raises(CalibrationError, match="an image and its calibration, found no image"):
        FrameEdges.of(replace(board_frames[0], image=None), HDL_64E)
