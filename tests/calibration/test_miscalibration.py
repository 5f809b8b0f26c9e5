"""The monitor of the calibration: silent while edges fit, an error within two seconds where they do not."""

from dataclasses import replace

import numpy as np
import pytest

from perception.calibration.edge_alignment import EdgeAlignment
from perception.calibration.frame_edges import FrameEdges
from perception.calibration.offset import UNKNOWN, OffsetEstimate
from perception.calibration.online import OnlineCalibration
from perception.calibration.online_edges import OnlineEdges
from perception.geometry.se3 import from_motion_vector
from perception.health.miscalibration import MiscalibrationMonitor, _UsualOffset, corrected
from perception.sensor import HDL_64E
from perception.snapshot import read_snapshot, write_snapshot
from perception.types import CALIBRATION, HealthLevel

ERRORS = {
    "pitch": [0.5, 0, 0, 0, 0, 0],
    "yaw": [0, -0.5, 0, 0, 0, 0],
    "roll": [
        0,
        0,
        0.65,
        0,
        0,
        0,
    ],  # edges alone, of a vehicle that stands, tell it to 0.165 degrees
    "all": [0.4, 1.2, -0.5, 0, 0, 0],
    "far": [0.5, -5.0, 0.3, 0, 0, 0],
}


def error_of(name):
    return from_motion_vector(np.array(ERRORS[name]) * [*[np.pi / 180] * 3, 1, 1, 1])


def findings(monitor, frames, error=None, count=21, first=0):
    """Return the findings of each frame of a drive that stands still before other boards each time."""
    found = []
    for index in range(first, first + count):
        frame = replace(frames[index % len(frames)], index=index, stamp_s=0.1 * index)
        found.append(monitor.update(corrected(frame, error), np.eye(4)))
    return found


def test_a_true_calibration_has_no_finding(board_frames):
    assert not any(findings(MiscalibrationMonitor(HDL_64E), board_frames, count=60))


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_is_named_within_two_seconds(board_frames, name):
    monitor = MiscalibrationMonitor(HDL_64E)
    found = findings(monitor, board_frames, error_of(name))
    (finding,) = found[-1]
    assert (finding.part, finding.level) == (CALIBRATION, HealthLevel.WARN)
    assert monitor.correction is None
    (finding,) = findings(monitor, board_frames, error_of(name), count=9, first=21)[-1]
    assert (finding.part, finding.level) == (CALIBRATION, HealthLevel.ERROR)
    assert finding.fault == "calibration off"
    assert finding.reason.endswith("recalibrate with: trifuse calibrate DRIVE")
    left = (monitor.correction @ error_of(name))[:3, :3]
    assert np.degrees(np.arccos(np.clip((np.trace(left) - 1) / 2, -1, 1))) < 0.25


@pytest.mark.parametrize("gain", [8.9, 9.0])
def test_an_offset_that_fits_no_better_than_none_is_no_fault(board_frames, monkeypatch, gain):
    """Nor is it learned as usual for the drive."""
    far = OffsetEstimate(np.radians([2.0, 0, 0, 0, 0, 0]), np.full(6, 0.002))
    monkeypatch.setattr(OnlineCalibration, "update", lambda self, frame, pose: far)
    monkeypatch.setattr(OnlineCalibration, "gain", lambda self, offset: gain)
    monitor = MiscalibrationMonitor(HDL_64E)
    found = [one[0].level for one in findings(monitor, board_frames, count=2) if one]
    assert found == ([] if gain < 9 else [HealthLevel.WARN, HealthLevel.ERROR])
    assert monitor._usual._newest is None


def test_edges_and_their_alignment_are_work_of_two_frames(board_frames, monkeypatch):
    done, of, align = [], FrameEdges.of, EdgeAlignment.align
    monkeypatch.setattr(FrameEdges, "of", lambda *given: (done.append("edges"), of(*given))[1])
    monkeypatch.setattr(
        EdgeAlignment, "align", lambda *given: (done.append(given[2]), align(*given))[1]
    )
    monitor = MiscalibrationMonitor(HDL_64E)
    findings(monitor, board_frames, count=19)
    done.clear()
    by_frame = []
    for index in range(19, 26):
        findings(monitor, board_frames, count=1, first=index)
        by_frame.append([*done])
        done.clear()
    assert by_frame == [["edges"], [(1.25,)], [], [], [], [], ["edges"]]


def test_a_shift_amid_a_drive_is_named_as_a_change(board_frames):
    """From the start it is within what scenes add to the estimates of different drives."""
    shift = from_motion_vector(np.array([0, 0, 0, 0.08, 0, 0]))
    assert not any(findings(MiscalibrationMonitor(HDL_64E), board_frames, shift, count=47))
    monitor = MiscalibrationMonitor(HDL_64E)
    assert not any(findings(monitor, board_frames, count=47))
    assert any(findings(monitor, board_frames, shift, count=20, first=47))


def test_at_night_edges_in_the_dark_are_left_out_and_pitch_is_held(board_frames):
    """The upper half is dark: half of the boards' upright edges are left, and none of the level ones."""
    height = board_frames[0].image.shape[0]
    night = [replace(one, image=one.image.copy()) for one in board_frames]
    for one in night:
        one.image[: height * 3 // 4] //= 16
    edges, lit = (FrameEdges.of(frames[0], HDL_64E) for frames in (board_frames, night))
    assert not edges.is_night
    assert lit.is_night
    assert 0 < len(lit.scan) < 0.65 * len(edges.scan)
    online = OnlineEdges(HDL_64E)
    error = from_motion_vector(np.array([0.01, 0, 0, 0, 0, 0]))
    estimates = []
    for index in range(30):
        frame = replace(night[index % len(night)], index=index, stamp_s=0.1 * index)
        estimates.append(online.update(corrected(frame, error), np.eye(4)))
    for estimate in filter(None, estimates):
        assert abs(estimate.offset[0]) < 1e-3
        assert estimate.deviations[0] == UNKNOWN[0]


def test_a_far_error_amid_a_drive_is_corrected_within_three_and_a_half_seconds(board_frames):
    monitor = MiscalibrationMonitor(HDL_64E)
    assert not any(findings(monitor, board_frames, count=27))
    findings(monitor, board_frames, error_of("far"), count=35, first=27)
    left = (monitor.correction @ error_of("far"))[:3, :3]
    assert np.degrees(np.arccos(np.clip((np.trace(left) - 1) / 2, -1, 1))) < 0.4


def test_a_far_shift_is_no_rotation(board_frames):
    monitor = MiscalibrationMonitor(HDL_64E)
    shift_SE3 = from_motion_vector(np.array([0, 0, 0, 0.5, 0, 0]))
    findings(monitor, board_frames, shift_SE3, count=30)
    np.testing.assert_allclose(monitor.correction @ shift_SE3, np.eye(4), atol=0.06)


def test_an_error_is_over_when_the_calibration_is_true_again(board_frames):
    monitor = MiscalibrationMonitor(HDL_64E)
    assert findings(monitor, board_frames, error_of("yaw"))[-1]
    assert not findings(monitor, board_frames, count=40, first=21)[-1]
    assert monitor.correction is None


def test_the_sentence_states_the_change(board_frames):
    found = findings(MiscalibrationMonitor(HDL_64E), board_frames, error_of("yaw"))[-1][0]
    assert "edges and motion of scan and image fit after a turn by " in found.reason
    assert "+0.5" in found.reason.split("(")[0].split(",")[1]


def test_frames_without_image_raise_no_finding(board_frames):
    blind = [replace(frame, image=None) for frame in board_frames]
    assert not any(findings(MiscalibrationMonitor(HDL_64E), blind, error_of("yaw"), count=40))


def test_a_frame_without_correction_stays_as_it_is(board_frames):
    assert corrected(board_frames[0], None) is board_frames[0]
    plain = replace(board_frames[0], calibration=None, image=None)
    assert corrected(plain, np.eye(4)) is plain


def test_a_monitor_goes_on_from_a_snapshot(board_frames):
    monitor = MiscalibrationMonitor(HDL_64E)
    findings(monitor, board_frames, error_of("yaw"), count=15)
    again = read_snapshot(write_snapshot(monitor), "snapshot")
    first, second = (
        findings(one, board_frames, error_of("yaw"), count=15, first=15) for one in (monitor, again)
    )
    assert first == second
    assert first[-1]
    np.testing.assert_array_equal(monitor.correction, again.correction)


def test_a_scene_that_tells_nothing_is_searched_seldom(board_frames, monkeypatch):
    """Ten alignments, of which the first two, the fourth and the eighth search; each search of all and of the newest."""
    searched = []
    far = OnlineEdges._far
    monkeypatch.setattr(
        OnlineEdges,
        "_far",
        lambda self, alignment: searched.append(alignment.frames) or far(self, alignment),
    )
    fog = [replace(one, image=np.full_like(one.image, 90)) for one in board_frames]
    assert not any(findings(MiscalibrationMonitor(HDL_64E), fog, count=21 + 9 * 6))
    assert searched == [4, 3] * 4


@pytest.mark.parametrize(("name", "is_named"), [("pitch", False), ("far", True)])
def test_beams_far_apart_tell_yaw_alone(board_frames, name, is_named):
    elevations_rad = HDL_64E.elevations_rad[::4]
    sensor = replace(HDL_64E, elevations_rad=elevations_rad)
    sparse = []
    for frame in board_frames:
        rows = frame.points_velo.reshape(len(HDL_64E.elevations_rad), -1, 4)[::4]
        sparse.append(replace(frame, points_velo=rows.reshape(-1, 4)))
    monitor = MiscalibrationMonitor(sensor)
    findings(monitor, sparse, error_of(name), count=29)
    assert (monitor.correction is not None) == is_named
    if is_named:
        np.testing.assert_allclose(monitor.correction[1, :3], [0, 1, 0], atol=0.01)
        left = np.degrees((monitor.correction @ error_of(name))[0, 2])
        assert abs(left) < 0.4


@pytest.mark.parametrize(("known_m", "is_change"), [(0.02, True), (0.2, False)])
def test_what_was_hardly_known_before_does_not_change(known_m, is_change):
    """Shifts by 30 cm, then by 2 cm: a change where the former were known to 2 cm, none where to 20 cm."""
    usual, right = _UsualOffset(), np.eye(6)[3]
    before, now = (
        OffsetEstimate(shift_m * right, np.full(6, deviation_m))
        for shift_m, deviation_m in ((0.3, known_m), (0.02, 0.02))
    )
    for _ in range(5):
        usual.add(before)
    assert (usual.share(now) > 1) == is_change
    assert usual.share(before) == 0
