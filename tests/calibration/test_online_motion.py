"""The motion of images in a street whose walls are painted all over."""

from dataclasses import replace

import numpy as np
import pytest

from perception.calibration.grey_image import GreyImage
from perception.calibration.offset import UNKNOWN, OffsetEstimate
from perception.calibration.online import OnlineCalibration, OnlineMotion
from perception.calibration.online_edges import OnlineEdges
from perception.calibration.surface_corners import (
    CornerTracks,
    ScanView,
    SurfaceCorners,
    SweepVelocity,
)
from perception.geometry.camera import project
from perception.geometry.se3 import from_motion_vector, inverse, motion_vector
from perception.health.miscalibration import corrected
from perception.sensor import HDL_64E
from tests.textured_scenes import CAM_SE3_VELO, IMAGE_P_CAM, TRUE, drive

NO_EDGES = OffsetEstimate(np.zeros(6), UNKNOWN, is_determined=False)
STILL = SweepVelocity(np.zeros(3), np.zeros(3), 0.1)


@pytest.fixture(scope="module")
def street():
    return drive(17)


def motion_of(frames, error=None):
    motion = OnlineMotion(HDL_64E)
    for frame in frames:
        motion.update(corrected(frame, error), frame.world_SE3_velo)
    return motion


def image_of(frame):
    return GreyImage.of(frame.image, TRUE, 720.0)


def corners_of(frame):
    image = image_of(frame)
    return SurfaceCorners.find(image, ScanView.of(frame, image), np.eye(4))


def test_corners_lie_on_the_planes_of_the_street(street):
    corners = corners_of(street[0])
    assert len(corners) == 250
    distances = np.abs(corners.planes_velo[:, 3])
    nearest = np.abs(distances[:, None] - [1.7, 6.0, 7.0, 60.0]).min(axis=1)
    assert np.median(nearest) < 0.01
    assert (nearest < 0.1).mean() > 0.9


def test_corners_are_tracked_to_where_the_motion_brings_them(street):
    corners = corners_of(street[0])
    first, later = image_of(street[0]), image_of(street[1])
    later_SE3_velo = inverse(street[1].world_SE3_velo) @ street[0].world_SE3_velo
    tracks = CornerTracks.track(corners, first, later, later_SE3_velo, STILL)
    assert len(tracks) > 210
    points = tracks.corners.surfaces_cam(np.eye(4)).points_m()
    moved = CAM_SE3_VELO @ later_SE3_velo @ inverse(CAM_SE3_VELO)
    expected_px, _ = project(IMAGE_P_CAM @ moved, points)
    misfits_px = np.linalg.norm(tracks.later_px - expected_px, axis=1)
    assert np.median(misfits_px) < 0.25
    assert np.median(np.linalg.norm(expected_px - tracks.corners.pixels, axis=1)) > 3


@pytest.mark.parametrize(
    "error",
    [(1.5, 0, 0, 0, 0, 0), (0, 0, -2, 0, 0, 0), (0, 0, 0, 0, 0.15, 0), (2, 0, 1.5, 0, 0, 0)],
    ids=["pitch", "roll", "down", "both"],
)
def test_an_error_is_found_without_edges(street, error):
    """This street tells pitch to 0.3 and roll to 0.45 degrees and height to 5 cm, whatever the calibration that it comes with."""
    error = np.array(error) * [*[np.pi / 180] * 3, 1, 1, 1]
    found = motion_of(street, from_motion_vector(error)).refined(NO_EDGES)
    assert found.is_determined
    told = [0, 2, 4]
    assert (found.deviations[told] < [np.radians(0.3), np.radians(0.45), 0.05]).all()
    left = motion_vector(from_motion_vector(found.offset) @ from_motion_vector(error))
    assert (np.abs(left) < 3 * found.deviations).all()


def test_a_vehicle_that_stands_leaves_what_edges_tell(street):
    standing = [replace(street[0], index=index, stamp_s=0.1 * index) for index in range(17)]
    by_edges = OffsetEstimate(np.full(6, 0.01), np.full(6, 0.002))
    assert motion_of(standing).refined(by_edges) is by_edges


def test_edges_hold_what_they_know_better(street):
    by_edges = OffsetEstimate(np.zeros(6), np.full(6, 1e-3))
    found = motion_of(street).refined(by_edges)
    assert np.abs(found.offset).max() < 3e-3


@pytest.mark.parametrize("axis", [0, 2], ids=["pitch", "roll"])
@pytest.mark.parametrize("true_deg", [0.0, 2.0])
def test_motion_tells_whether_a_claimed_offset_is_true(street, axis, true_deg):
    """Edges that fit beside their own, as those of a shadow or a rail, claim an offset of 2 degrees."""
    claim = np.radians(2.0) * np.eye(6)[axis]
    error = from_motion_vector(-np.radians(true_deg) * np.eye(6)[axis])
    gain = motion_of(street, error).gain(claim)
    assert gain > 20 if true_deg else gain < -20


def test_the_gain_is_zero_without_tracks(street):
    assert motion_of(street[:1]).gain(np.full(6, 0.01)) == 0.0


def test_frames_without_image_and_gaps_are_left_out(street):
    blind = [replace(frame, image=None) for frame in street]
    assert motion_of(blind).refined(NO_EDGES) is NO_EDGES
    with_gaps = [replace(frame, stamp_s=20 * frame.stamp_s) for frame in street]
    assert motion_of(with_gaps).refined(NO_EDGES) is NO_EDGES


def test_an_image_of_another_size_is_no_later_one(street):
    cropped = [
        frame if frame.index % 2 else replace(
            frame, image=frame.image[:, :600].copy(), calibration=replace(TRUE, image_size_px=(600, 188))
        )
        for frame in street
    ]  # fmt: skip
    assert motion_of(cropped).refined(NO_EDGES) is NO_EDGES


@pytest.mark.parametrize("is_night", [False, True])
def test_motion_is_not_used_at_night(street, monkeypatch, is_night):
    """Headlights light what moves along with the vehicle."""
    refined = []
    monkeypatch.setattr(OnlineMotion, "refined", lambda self, known: refined.append(known) or known)
    monkeypatch.setattr(OnlineEdges, "is_night", property(lambda self: is_night))
    monkeypatch.setattr(OnlineEdges, "update", lambda self, frame, pose: NO_EDGES)
    online = OnlineCalibration(HDL_64E)
    found = [online.update(frame, frame.world_SE3_velo) for frame in street]
    assert found[-1] is NO_EDGES
    assert bool(refined) != is_night
