"""Errors, scores and curves of one followed object, by values that can be counted by hand."""

import numpy as np
import pytest

from perception.errors import PerceptionError
from perception.evaluation.single_object import metrics
from perception.evaluation.single_object.measure import ObjectErrors, SingleObjectReport
from perception.evaluation.single_object.metrics import (
    SingleObjectErrors,
    area_under_curve,
    correct_frames,
    cumulative_success,
    location_curve,
    precision_curve,
    single_object_errors,
    single_object_metrics,
    success_curve,
)
from perception.evaluation.single_object.track import (
    ObjectSequence,
    PredictedTrack,
    TargetObject,
    TrueTrack,
)
from perception.evaluation.single_object.tracker_runs import fusion_parameters
from perception.tracking.single_object.config import (
    FusionTrackerConfig,
    ImageMeanShiftConfig,
    SingleObjectTrackerConfig,
)
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Calibration
from tests.faults import fault

SIZE = (4.0, 2.0, 1.5)
# 100 px focal length, centre at (100, 50), at the LiDAR itself.
CAMERA = Calibration(
    image_P_cam=np.array([[100.0, 0, 100, 0], [0, 100, 50, 0], [0, 0, 1, 0]]),
    cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    image_size_px=(201, 101),
)


def boxes(x_m: list[float], yaw_rad: float | list[float] = 0.0) -> Boxes3D:
    count = len(x_m)
    bottom_m = np.column_stack([x_m, np.zeros(count), np.full(count, -0.75)])
    return Boxes3D(bottom_m, np.tile(SIZE, (count, 1)), np.broadcast_to(yaw_rad, count) * 1.0)


def true_track(frames: list[int], x_m: list[float], yaw_rad: float = 0.0) -> TrueTrack:
    count = len(frames)
    return TrueTrack(
        frames=np.array(frames),
        stamps_s=np.array(frames) * 0.1,
        boxes_velo=boxes(x_m, yaw_rad),
        boxes_px=np.tile([80.0, 40, 120, 60], (count, 1)),
        velocities_m_s=np.tile([3.0, 0.0], (count, 1)),
        occlusion=np.zeros(count, np.int64),
    )


def prediction(
    x_m: float | None,
    yaw_rad: float = 0.0,
    state: TrackStatus = TrackStatus.SEEN,
    box_px: tuple[float, ...] | None = None,
) -> TrackedObject:
    return TrackedObject(
        state,
        None if x_m is None else boxes([x_m], yaw_rad),
        np.array([3.0, 0.4]),
        None if box_px is None else np.array(box_px),
    )


def predicted_track(frames: list[int], predictions: list[TrackedObject]) -> PredictedTrack:
    return PredictedTrack.from_predictions(frames, predictions, [0.002] * len(frames))


def errors_of(
    predictions: list[TrackedObject], camera: Calibration | None = None
) -> SingleObjectErrors:
    frames = list(range(len(predictions)))
    return single_object_errors(
        true_track(frames, [12.0] * len(frames)), predicted_track(frames, predictions), camera
    )


def test_errors_of_boxes_in_space():
    # Aside by 1 m of 4 m of length: 3 shared of 5. The last one is turned about.
    errors = errors_of(
        [prediction(12.0), prediction(13.0, 0.1), prediction(22.0), prediction(12.0, np.pi)]
    )
    np.testing.assert_allclose(errors.center_m, [0, 1, 10, 0], atol=1e-12)
    np.testing.assert_allclose(errors.heading_rad, [0, 0.1, 0, -np.pi], atol=1e-12)
    assert errors.overlap[[0, 2, 3]] == pytest.approx([1, 0, 1])
    assert 0.5 < errors.overlap[1] < 0.6
    assert errors.overlap[1] == errors_of([prediction(13.0, 0.1)]).overlap[0]
    np.testing.assert_allclose(errors.velocity_m_s, 0.4)
    assert errors.is_drifted.tolist() == [False, False, True, False]
    assert errors.has_3d_boxes


def test_height_counts_in_the_distance_of_the_centres():
    high = Boxes3D(np.array([[12.0, 0, -0.25]]), np.array([[5.0, 3.0, 2.5]]), np.zeros(1))
    one = TrackedObject(TrackStatus.SEEN, high, np.zeros(2), None)
    # The bottom is 0.5 m higher and the box 1 m taller: the centre is 1 m higher. Length and width do not move it.
    assert errors_of([one]).center_m.tolist() == [1.0]


def test_only_frames_with_a_label_and_a_box_are_evaluated():
    truth = true_track([3, 4, 6, 9], [10.0, 11.0, 13.0, 16.0])
    track = predicted_track([3, 4, 5, 6, 7], [prediction(x) for x in (10.0, 11.5, 0.0, 13.0, 0.0)])
    errors = single_object_errors(truth, track)
    assert errors.frames.tolist() == [3, 4, 6]
    np.testing.assert_allclose(errors.center_m, [0, 0.5, 0])


def test_a_frame_without_a_box_is_off_and_has_no_distance():
    errors = errors_of([prediction(12.0), prediction(None, state=TrackStatus.LOST)])
    assert errors.overlap.tolist() == [1.0, 0.0]
    assert np.isnan(errors.center_m[1])
    scores = single_object_metrics(errors)
    assert scores.center_m == 0.0
    assert scores.overlap_success == scores.precision == 0.5
    assert (scores.seen, scores.predicted, scores.lost, scores.drifted) == (0.5, 0.0, 0.5, 0.5)
    assert scores.lost_from_frame == 1


def test_boxes_in_the_image_are_the_projected_ones_clipped_as_labels_are():
    # The front stands at 10 m, 2 m wide and 1.5 m high: 90 to 110 and 42.5 to 57.5.
    errors = errors_of([prediction(12.0, box_px=(0, 0, 9, 9))], CAMERA)
    assert errors.center_px[0] == pytest.approx(0.0, abs=1e-9)
    assert errors.overlap_px[0] == pytest.approx(20 * 15 / (40 * 20))
    behind = errors_of([prediction(-12.0)], CAMERA)
    assert np.isnan(behind.center_px[0])
    assert behind.overlap_px[0] == 0.0


def test_a_tracker_in_the_image_has_no_figures_in_space():
    at = [prediction(None, box_px=(80, 40, 120, 60)), prediction(None, box_px=(83, 44, 123, 64))]
    errors = errors_of([*at, prediction(None), prediction(None, box_px=(0, 0, 9, 9))], CAMERA)
    np.testing.assert_allclose(errors.center_px[:2], [0, 5])
    assert not errors.has_3d_boxes
    assert errors.is_drifted.tolist() == [False, False, True, True]
    scores = single_object_metrics(errors)
    missing = (scores.center_m, scores.overlap_success, scores.heading_success, scores.success)
    assert np.isnan(missing).all()
    assert np.isnan(scores.velocity_m_s)
    assert scores.location_success == 0.5
    assert scores.in_image == 0.75
    assert scores.lost_from_frame == 2


def test_frames_in_which_the_camera_does_not_see_the_object_do_not_count_in_the_image():
    truth = true_track([0, 1], [12.0, 12.0])
    truth.boxes_px[1] = np.nan
    errors = single_object_errors(
        truth, predicted_track([0, 1], [prediction(12.0), prediction(12.0)]), CAMERA
    )
    scores = single_object_metrics(errors)
    assert scores.location_success == 1.0
    assert np.isnan(errors.overlap_px[1])


@pytest.mark.parametrize(
    ("yaw_rad", "folded", "unfolded"),
    [(0.2, 0.2, 0.2), (-0.2, 0.2, 0.2), (np.pi - 0.2, 0.2, np.pi - 0.2), (2.0, np.pi - 2, 2.0)],
)
def test_the_printed_heading_error_does_not_know_front_from_back(
    yaw_rad: float, folded: float, unfolded: float
):
    scores = single_object_metrics(errors_of([prediction(12.0, yaw_rad)]))
    assert scores.folded_heading_rad == pytest.approx(folded)  # arctan |cross / dot| of (7.4)
    assert folded == pytest.approx(abs(np.arctan(np.sin(yaw_rad) / np.cos(yaw_rad))))
    assert scores.heading_rad == pytest.approx(unfolded)


def test_headings_are_compared_around_the_circle():
    truth = true_track([0, 1], [12.0, 12.0], yaw_rad=3.1)
    errors = single_object_errors(
        truth, predicted_track([0, 1], [prediction(12, -3.1), prediction(12, 3.1 - 20 * np.pi)])
    )
    np.testing.assert_allclose(errors.heading_rad, [2 * np.pi - 6.2, 0], atol=1e-9)
    assert single_object_metrics(errors).heading_bias_rad == pytest.approx(np.pi - 3.1)


def test_success_needs_more_than_the_threshold_and_less_than_the_angle(monkeypatch):
    # 4 m long boxes: 2.4 m apart share 1.6 of 6.4, which is exactly a quarter.
    quarter, more = errors_of([prediction(14.4)]), errors_of([prediction(14.39)])
    monkeypatch.setattr(metrics, "MIN_OVERLAP", float(quarter.overlap[0]))
    assert quarter.overlap[0] == pytest.approx(0.25)
    assert correct_frames(quarter).overlap.tolist() == [False]
    assert correct_frames(more).overlap.tolist() == [True]
    headings = errors_of([prediction(12, np.radians(9.9)), prediction(12, np.radians(170.2))])
    assert correct_frames(headings).heading.tolist() == [True, False]


def test_one_pass_evaluation_counts_thresholds():
    # A perfect frame and one without overlap, 10 m off.
    errors = errors_of([prediction(12.0), prediction(22.0)])
    success = success_curve(errors)
    assert success[[0, 1, 20]].tolist() == [1.0, 0.5, 0.5]  # at least 0 are both
    assert area_under_curve(success) == pytest.approx(0.5 + 0.5 / 40)
    precision = precision_curve(errors)
    assert precision.tolist() == [0.5] * 21
    assert single_object_metrics(errors).precision == pytest.approx(0.5)


def test_precision_falls_with_the_distance():
    # 0.5 m off: within at 0.5, 0.6 .. 2.0 m of 0, 0.1 .. 2.0 m; the first slope counts half.
    scores = single_object_metrics(errors_of([prediction(12.5)]))
    assert scores.precision == pytest.approx(15.5 / 20)
    assert single_object_metrics(errors_of([prediction(14.5)])).precision == 0.0


def test_the_cumulative_plot_ends_at_the_share_of_right_frames():
    curve = cumulative_success(np.array([True, False, True, True]))
    assert curve.tolist() == [0, 0.25, 0.25, 0.5, 0.75]
    assert cumulative_success(np.zeros(0, bool)).tolist() == [0]


def test_the_location_plot_counts_frames_nearer_than_a_threshold():
    errors = errors_of([prediction(None, box_px=(83, 44, 123, 64)), prediction(None)])
    assert location_curve(errors, np.array([0.0, 5.0, 5.1])).tolist() == [0, 0, 0.5]


def test_an_object_found_again_is_not_lost_for_good():
    errors = errors_of(
        [prediction(12), prediction(40), prediction(12.2), prediction(40), prediction(40)]
    )
    scores = single_object_metrics(errors)
    assert scores.drifted == 0.6
    assert scores.lost_from_frame == 3
    assert (
        single_object_metrics(errors_of([prediction(40), prediction(12)])).lost_from_frame is None
    )
    assert single_object_metrics(errors_of([prediction(40), prediction(40)])).lost_from_frame == 0


def test_times_and_frames_of_several_tracks_together():
    near, far = errors_of([prediction(12.0)] * 3), errors_of([prediction(13.0)])
    scores = single_object_metrics(SingleObjectErrors.concatenate([near, far]))
    assert scores.frames == 4
    assert scores.center_m == 0.25  # of all frames, not of the two tracks
    assert scores.ms_per_frame == scores.ms_p99 == pytest.approx(2.0)


def test_no_frame_gives_no_figure():
    errors = single_object_errors(true_track([0], [12.0]), predicted_track([], []))
    scores = single_object_metrics(errors)
    assert scores.frames == 0
    assert np.isnan([scores.center_m, scores.success, scores.drifted, scores.ms_p99]).all()
    assert scores.lost_from_frame is None


def test_the_default_parameters_of_the_fusion_tracker_are_those_of_the_thesis():
    rows = fusion_parameters(SingleObjectTrackerConfig()).rows
    assert rows["h-fus"] == rows["thesis"]
    fewer = SingleObjectTrackerConfig(fusion=FusionTrackerConfig(image=ImageMeanShiftConfig(2)))
    assert fusion_parameters(fewer).rows["h-fus"]["shifts in the image"] == 2


def test_what_the_thesis_prints_stands_below_the_measured_values():
    truth, errors = true_track([0, 1], [12.0, 12.0]), errors_of([prediction(12.5)] * 2)
    printed = {"center_m": {"h-fus": 0.3, "l-fus": 0.25}}
    sequence = ObjectSequence("3.2 (1)", "0000", 1, "Cyclist", 0, 1, printed=printed)
    one = ObjectErrors(TargetObject(sequence, truth, 2), {"h-fus": errors, "default": errors}, {})
    report = SingleObjectReport(("h-fus", "default"), (one,))
    tables = {table.title.partition(":")[0]: table for table in report.tables()}
    assert tables["Table 7.6, E3D (7.3)"].to_json() == {
        "3.2 (1)": {"h-fus": pytest.approx(0.5), "default": pytest.approx(0.5)},
        "3.2 (1) thesis": {"h-fus": 0.3, "default": None},
    }
    assert list(tables["Table 7.6, E2D (7.3)"].rows) == ["3.2 (1)"]


def test_what_cannot_be_measured_is_refused():
    with fault(PerceptionError, where="TrueTrack.stamps_s", found="shape (2,)"):
        TrueTrack(np.arange(3), np.zeros(2), boxes([1, 2]), np.zeros((2, 4)), np.zeros((2, 2)), np.zeros(2, int))  # fmt: skip
