"""From candidates to vehicles, with a network that takes bright for likely."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.reference.depthcn import detect_one_by_one, suppress_by_loop, verify_one_by_one
from data.open_drive import open_drive
from perception.detection.config import NmsConfig
from perception.detection.depthcn.crops import windows_px
from perception.detection.depthcn.detector import DepthCn
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.proposals import Proposals
from perception.errors import ModelError, PerceptionError
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import VIRTUAL_CAMERA, project_frame
from perception.types import Calibration, Frame
from tests.faults import fault

# Camera and LiDAR in one place: x forward is depth, y left is -u, z up is -v; 100 px focal length.
AXES = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
CAMERA = np.array([[100, 0, 100, 0], [0, 100, 60, 0], [0, 0, 1, 0.0]])
CALIBRATION = Calibration(CAMERA, AXES, (200, 120))


def maps_of_reflectance(reflectance):
    """10 m everywhere, so that only the reflectance of a place makes it bright or dark."""
    reflectance = reflectance.astype(np.float32)
    valid = np.ones(reflectance.shape, bool)
    return DenseMaps(np.full(reflectance.shape, 10.0, np.float32), reflectance, valid, ~valid)


def proposals_at(boxes):
    boxes = np.array(boxes, float).reshape(-1, 4)
    return Proposals(boxes, np.full(len(boxes), 10.0), np.arange(-1, len(boxes)))


@pytest.fixture
def three_places():
    """Three boxes, the middle one bright, the right one half bright and over the edge."""
    reflectance = np.zeros((120, 200))
    reflectance[20:60, 80:120] = 1.0
    reflectance[20:60, 160:] = 0.5
    return maps_of_reflectance(reflectance), [
        [10, 20, 50, 60],
        [80, 20, 120, 60],
        [160, 20, 230, 60],
        [82, 20, 122, 60],
    ]


@pytest.fixture
def detector(write_model):
    return DepthCn(write_model(channels="reflectance", planes=1))


def test_best_of_each_place_is_kept_best_first(detector, three_places):
    dense, boxes = three_places
    verified = detector.verify(proposals_at(boxes), dense, CALIBRATION)
    np.testing.assert_allclose(verified.scores[[0, 1]], [0, 1], atol=0.03)
    assert 0.2 < verified.scores[2] < 0.5
    assert 0.9 < verified.scores[3] < verified.scores[1]
    # The dark one scores too low, the shifted one is beaten.
    assert verified.kept.tolist() == [1, 2]
    detections = verified.detections
    np.testing.assert_allclose(detections.boxes_px, [[80, 20, 120, 60], [160, 20, 199, 60]])
    assert detections.types.tolist() == ["Car", "Car"]
    assert detections.scores[0] == verified.scores[1]


def test_each_detection_owns_the_points_of_its_proposal(detector, three_places):
    dense, boxes = three_places
    verified = detector.verify(proposals_at(boxes), dense, CALIBRATION)
    # Points of no candidate, of the dark one, of the bright, of the one at the edge, of the beaten.
    assert verified.owners.tolist() == [-1, -1, 0, 1, -1]


def test_what_leaves_the_image_is_no_detection(write_model, three_places):
    dense, boxes = three_places
    outside = proposals_at([*boxes[:2], [200, 20, 260, 60]])
    model = write_model(channels="reflectance", planes=1)
    detector = DepthCn(model, nms=NmsConfig(min_score=0.0))
    verified = detector.verify(outside, dense, CALIBRATION)
    assert verified.kept.tolist() == [1, 0]


def test_thresholds_decide_what_is_kept(write_model, three_places):
    dense, boxes = three_places
    model = write_model(channels="reflectance", planes=1)
    strict = DepthCn(model, nms=NmsConfig(min_score=0.9))
    lenient = DepthCn(model, nms=NmsConfig(min_score=0.0, max_iou=0.95))
    assert strict.verify(proposals_at(boxes), dense, CALIBRATION).kept.tolist() == [1]
    assert lenient.verify(proposals_at(boxes), dense, CALIBRATION).kept.tolist() == [1, 3, 2, 0]


def test_the_thesis_suppresses_no_proposal(write_model, three_places):
    dense, boxes = three_places
    model = write_model(channels="reflectance", planes=1, method="thesis")
    detector = DepthCn(model, nms=NmsConfig(min_score=0.0, max_iou=0.1))
    kept = detector.verify(proposals_at([*boxes, boxes[1]]), dense, CALIBRATION).kept
    assert kept.tolist() == [1, 4, 3, 2, 0]


def test_no_proposal_needs_no_network(detector, three_places, monkeypatch):
    def refuse(inputs):
        raise AssertionError("called for nothing")

    monkeypatch.setattr(detector.verifier, "model", refuse)
    verified = detector.verify(proposals_at([]), three_places[0], CALIBRATION)
    assert len(verified.detections) == 0
    assert verified.owners.tolist() == [-1]


def test_a_batch_of_proposals_equals_one_by_one(write_model):
    generator = np.random.default_rng(1)
    detector = DepthCn(write_model(window="metric"))
    dense = maps_of_reflectance(generator.uniform(size=(120, 200)))
    corner = generator.uniform((0, 0), (150, 50), (30, 2))
    proposals = proposals_at(np.hstack([corner, corner + generator.uniform(10, 60, (30, 2))]))
    verified = detector.verify(proposals, dense, CALIBRATION)
    picture = encode_channels(dense, CALIBRATION.image_P_velo, 1.73)
    windows = windows_px("metric", proposals.boxes_px, proposals.depths_m, 100.0)
    judged = verify_one_by_one(detector.verifier, picture, windows)
    np.testing.assert_allclose(verified.scores, judged.scores, atol=1e-6)
    clipped = np.clip(judged.boxes_px, 0, [199, 119, 199, 119])
    np.testing.assert_allclose(verified.boxes_px, clipped, atol=1e-3)
    assert verified.kept.tolist() == suppress_by_loop(verified.boxes_px, verified.scores, 0.5)


def test_frame_without_camera_has_the_virtual_one(write_model):
    scan = np.random.default_rng(0).uniform((5, -4, -1.7, 0), (20, 4, 0.5, 1), (3000, 4))
    frame = Frame(0, 0.0, scan.astype(np.float32))
    detector = DepthCn(write_model())
    found = detector.detect(frame)
    expected = detector.detect(replace(frame, calibration=VIRTUAL_CAMERA))
    np.testing.assert_array_equal(found.boxes_px, expected.boxes_px)
    np.testing.assert_array_equal(found.scores, expected.scores)


def test_a_frame_without_points_in_view_has_no_detections(write_model):
    behind = np.array([[-5, 0, 0, 0.5], [-6, 1, 0, 0.5]], np.float32)
    assert len(DepthCn(write_model()).detect(Frame(0, 0.0, behind, calibration=CALIBRATION))) == 0


def street():
    """A road of 1.5 m below the camera, and a box of points 10 m ahead and one 20 m to the left."""
    generator = np.random.default_rng(0)
    road = np.column_stack([generator.uniform((4, -12), (40, 12), (6000, 2)), np.full(6000, -1.5)])
    near = generator.uniform((10, -1, -1.4), (10.3, 1, 0.2), (400, 3))
    left = generator.uniform((20, 5, -1.4), (20.3, 7, 0.2), (300, 3))
    points = np.vstack([road, near, left])
    light = np.full((len(points), 1), 0.5)
    return Frame(0, 0.0, np.hstack([points, light]).astype(np.float32), calibration=CALIBRATION)


def test_whole_way_from_scan_to_detections(write_model):
    detector = DepthCn(write_model(), nms=NmsConfig(min_score=0.0))
    frame = street()
    verified = detector.verify_frame(frame)
    assert len(verified.proposals) == 2
    detections = verified.detections
    order = np.argsort(detections.boxes_px[:, 0])
    # 100 px focal length: 2 m at 10 m are 20 px around column 100; 2 m at 20 m, 5 to 7 m left, 65 to 75.
    np.testing.assert_allclose(
        detections.boxes_px[order][:, [0, 2]], [[65, 75], [90, 110]], atol=1.6
    )
    owners = verified.owners[6000:]
    assert (np.bincount(owners[owners >= 0]) > 250).all()
    again = detector.verify_frame(frame, densify(project_frame(frame)))
    np.testing.assert_array_equal(again.detections.boxes_px, detections.boxes_px)
    np.testing.assert_array_equal(detector.detect(frame).scores, detections.scores)


def with_pole_and_kerb():
    """The street with a pole 0.2 m wide and a kerb 0.5 m high, 10 m ahead and to the right."""
    generator = np.random.default_rng(1)
    pole = generator.uniform((10, -4.1, -1.4), (10.1, -3.9, 0.2), (200, 3))
    kerb = generator.uniform((10, -8, -1.4), (10.3, -6, -1.0), (200, 3))
    added = np.hstack([np.vstack([pole, kerb]), np.full((400, 1), 0.5)]).astype(np.float32)
    frame = street()
    return replace(frame, points_velo=np.vstack([frame.points_velo, added]))


def test_poles_and_kerbs_are_not_verified(write_model, monkeypatch):
    frame = with_pole_and_kerb()

    def count(min_size_m=None, method="default"):
        model = write_model(method=method, window="metric")
        with monkeypatch.context() as patch:
            if min_size_m is not None:
                patch.setattr("perception.detection.depthcn.detector.MIN_SIZE_M", min_size_m)
            return len(DepthCn(model).propose(frame))

    # At 100 px of focal length, the margin above a cluster 10 m ahead is half a metre.
    assert count((0.0, 0.0)) == 4
    assert count((0.3, 0.0)) == count() == 3
    assert count((0.0, 1.2)) == 3
    assert count((0.3, 1.2)) == 2
    assert count(method="thesis") == count((0.0, 0.0), method="thesis")


@pytest.mark.parametrize("min_score", [0.0, 0.2, 0.6])
def test_the_reference_keeps_the_same_detections(write_model, min_score):
    nms = NmsConfig(min_score=min_score)
    detector = DepthCn(write_model(), nms=nms)
    detections = detector.detect(street())
    reference = detect_one_by_one(detector.verifier, street(), nms=nms)
    np.testing.assert_allclose(reference.boxes_px, detections.boxes_px, atol=1e-3)
    np.testing.assert_allclose(reference.scores, detections.scores, atol=1e-6)


def test_real_frame_is_detected_in_without_its_image(kitti_root, write_model):
    root = kitti_root / "raw" / "2011_09_26" / "2011_09_26_drive_0005_sync"
    detector = DepthCn(write_model(window="metric"))
    blind, seeing = (open_drive(root, images=images)[10] for images in (False, True))
    assert blind.image is None
    verified = detector.verify_frame(blind)
    assert len(verified.proposals) > 10
    assert verified.owners.max() == len(verified.kept) - 1
    again = detector.detect(seeing)
    np.testing.assert_array_equal(again.boxes_px, verified.detections.boxes_px)
    np.testing.assert_array_equal(again.scores, verified.detections.scores)
    assert (again.boxes_px >= 0).all()
    assert (again.boxes_px[:, 2:] <= (1241, 374)).all()


@pytest.mark.parametrize(
    ("changes", "expected", "found"),
    [
        (
            {"channels": "depth,colour,height"},
            "channels among depth, height, reflectance, as many as its input has",
            "depth, colour, height for an input of 3 channels",
        ),
        (
            {"channels": "depth"},
            "channels among depth, height, reflectance, as many as its input has",
            "depth for an input of 3 channels",
        ),
        ({"window": "round"}, "window box or metric", "round"),
        ({"input_height": "128"}, "input_height 66", "128"),
    ],
)
def test_network_of_another_kind_is_refused(write_model, changes, expected, found):
    with pytest.raises(ModelError) as error:
        DepthCn(write_model(**changes))
    assert (error.value.expected, error.value.found) == (expected, found)


def test_window_that_is_not_finite_is_refused(detector, three_places):
    with pytest.raises(PerceptionError) as error:
        detector.verify(proposals_at([[0, 0, np.nan, 10]]), three_places[0], CALIBRATION)
    assert error.value.expected == "finite windows"


def test_the_likeliest_of_several_classes_is_detected(write_model, three_places):
    file = write_model(
        channels="depth,reflectance", classes="Pedestrian,Car", planes=2, by_plane=True
    )
    dense, boxes = three_places
    verified = DepthCn(file).verify(proposals_at(boxes), dense, CALIBRATION)
    # Depth is the same everywhere; the bright place alone is brighter than that.
    depth_score = verified.scores[0]
    assert verified.found.types.tolist() == ["Pedestrian", "Car", "Pedestrian", "Car"]
    assert verified.scores[1] > 0.95 > depth_score > 0.1
    assert verified.detections.types.tolist() == ["Car", "Pedestrian", "Pedestrian"]


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({"classes": "Car,Van"}, "1 scores of a crop"),
        ({"classes": "Car", "by_plane": True}, "3 scores of a crop"),
    ],
)
def test_a_file_with_other_scores_than_classes_is_refused(write_model, options, found):
    with fault(ModelError, "tiny.onnx", "a score of each of its classes", found):
        DepthCn(write_model(**options))
