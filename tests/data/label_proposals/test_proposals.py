"""Objects of a drive from detections of single frames: linked, joined, smoothed, and one box where they are parked."""

from dataclasses import replace

import numpy as np
import pytest

from data.label_proposals.association import link
from data.label_proposals.observations import Observations
from data.label_proposals.proposals import (
    Proposal,
    ProposalFile,
    observed_objects,
    to_proposals,
)
from data.label_proposals.proposed_labels import ProposedLabels
from data.label_proposals.review import Decision, read_review, reviewed
from data.label_proposals.review_page import preview
from perception.errors import LabelError
from perception.geometry.se3 import wrap
from perception.types import Boxes3D, Calibration, Frame
from tests.faults import fault

FRAMES = np.arange(30)
STAMPS_S = 0.1 * FRAMES


def observed(place, frames=FRAMES, *, yaw=0.0, size=(4.4, 1.8, 1.5), kind="Car", score=0.8, seed=0):
    """Return noisy observations of an object at `place(t)`."""
    rng, count = np.random.default_rng(seed), len(frames)
    bottoms = np.array([[*place(0.1 * frame), -1.7] for frame in frames])
    bottoms[:, :2] += rng.normal(0, 0.1, (count, 2))
    sizes = np.array(size) + rng.normal(0, 0.1, (count, 3))
    yaws = np.full(count, yaw) + rng.normal(0, 0.05, count)
    return Observations(
        np.array(frames), 0.1 * np.array(frames), Boxes3D(bottoms, sizes, yaws),
        np.full(count, kind), np.full(count, 2 if kind == "Pedestrian" else 0), np.full(count, score),
        np.full((count, 2), np.nan), np.full(count, 50), np.zeros((count, 2)),
    )  # fmt: skip


def joined(*parts):
    whole = Observations.concatenate(parts)
    return whole[np.argsort(whole.frames, kind="stable")]


def proposals_of(*parts):
    found = observed_objects(joined(*parts), FRAMES, STAMPS_S)
    for one in found:
        one.points.update(dict.fromkeys(range(30), 50))
    return to_proposals(found)


def test_objects_that_cross_are_kept_apart():
    there = observed(lambda t: (10 * t, 2.0), seed=1)
    back = observed(lambda t: (30 - 10 * t, -2.0), yaw=np.pi, seed=2)
    whole = joined(there, back)
    sides = [np.sign(whole.boxes_world.bottom_m[rows, 1]) for rows in link(whole)]
    assert [len(one) for one in sides] == [30, 30]
    assert all(len(set(one)) == 1 for one in sides)


def test_a_gap_is_filled_and_a_parked_object_is_one():
    seen = [k for k in FRAMES if not 10 <= k < 18]
    [moving] = proposals_of(observed(lambda t: (10 * t, 0.5 * t), seen, yaw=0.05))
    assert moving.is_moving and moving.frames.tolist() == list(range(30))
    truth = np.column_stack([10 * STAMPS_S, 0.5 * STAMPS_S])
    away_m = np.linalg.norm(moving.boxes_world.bottom_m[:, :2] - truth, axis=1)
    assert away_m.max() < 0.35 and away_m.mean() < 0.12
    assert np.abs(moving.boxes_world.yaw_rad - 0.05).max() < 0.05
    # Seen at the start and at the end alone, and once from behind.
    ends = [observed(lambda _: (12.0, 6.0), frames, yaw=yaw) for frames, yaw in ((range(8), 0.3), (range(20, 30), 0.3 + np.pi))]  # fmt: skip
    [parked] = proposals_of(*ends)
    assert not parked.is_moving and len(parked.frames) == 30
    boxes = parked.boxes_world
    assert np.ptp(boxes.bottom_m, axis=0).max() == 0
    np.testing.assert_allclose(boxes.bottom_m[0, :2], [12, 6], atol=0.1)
    np.testing.assert_allclose(boxes.size_m[0], [4.4, 1.8, 1.5], atol=0.1)
    assert abs(np.sin(wrap(boxes.yaw_rad[0] - 0.3))) < 0.05


def test_what_is_detected_now_and_then_is_not_confident():
    steady = observed(lambda _: (5.0, 5.0), seed=1)
    rare = observed(lambda _: (15.0, -5.0), [0, 9, 10, 12, 20, 29], score=0.75, seed=2)
    found = proposals_of(steady, rare)
    assert [one.confidence > 0.4 for one in found] == [True, False]
    # By log-odds of 0.8, ln(1 + 2.9 / 0.6) and no missed frame.
    evidence = 1.386 + 0.8 * np.log(1 + 2.9 / 0.6) + 4.0 - 5.3
    assert found[0].confidence == pytest.approx(1 / (1 + np.exp(-evidence)), abs=0.001)
    assert "unsure" not in found[0].reasons


def test_what_is_parked_is_there_before_and_afterwards_while_it_has_returns():
    parked = observed(lambda _: (5.0, 5.0), range(10, 20))
    [found] = observed_objects(parked, FRAMES, STAMPS_S)
    found.points.update(dict.fromkeys(range(6, 27), 50) | {4: 50, 28: 50})
    [one] = to_proposals([found])
    assert one.frames.tolist() == list(range(6, 27))
    assert np.ptp(one.boxes_world.bottom_m, axis=0).max() == 0


def test_a_vehicle_that_drifts_with_the_poses_is_parked():
    parked = observed(lambda t: (12.0 + 0.3 * t, 6.0), yaw=1.2)
    [one] = proposals_of(parked)
    assert not one.is_moving
    np.testing.assert_allclose(one.boxes_world.yaw_rad, 1.2, atol=0.05)


def test_a_car_that_comes_to_a_stop_has_moved_and_one_whose_box_jumps_has_not():
    def brakes(t):
        return 10 + 4.3 * min(t, 1) - 2.15 * min(t, 1) ** 2, 3.0

    [one] = proposals_of(observed(brakes))
    assert one.is_moving
    rests_m = one.boxes_world.bottom_m[12:, 0]
    np.testing.assert_allclose(rests_m, 12.15, atol=0.3)
    assert abs(one.boxes_world.bottom_m[3, 0] - brakes(0.3)[0]) < 0.3
    [parked] = proposals_of(observed(lambda t: (13.0 - 2.5 * (t < 0.35), 3.0)))
    assert not parked.is_moving


def test_an_object_has_its_commonest_class():
    cars = observed(lambda _: (5.0, 5.0), range(20))
    vans = observed(lambda _: (5.0, 5.0), range(20, 30), kind="Van")
    [found] = proposals_of(cars, vans)
    assert found.kind == "Car"
    assert "class unsure, Car in 67%" in found.reasons


def test_no_observation_is_no_proposal():
    assert proposals_of(Observations.empty()) == []


def proposal(number, confidence):
    boxes = Boxes3D(np.zeros((2, 3)), np.ones((2, 3)), np.zeros(2))
    points = np.array([5, 6])
    return Proposal(number, "Car", confidence, True, np.arange(2), boxes, points, 1, ("few returns",))  # fmt: skip


def test_a_box_of_few_returns_is_less_sure_than_its_object():
    one = replace(proposal(1, 0.9), points=np.array([0, 2]))
    np.testing.assert_allclose(one.box_confidences, [0.0, 0.72])
    assert [label.frames.tolist() for label in reviewed([one], {}, 0.5)] == [[1]]
    [accepted] = reviewed([one], {1: Decision("accept")}, 0.5)
    assert accepted.frames.tolist() == [0, 1]
    assert reviewed([one], {}, 0.8) == []


def test_decisions_come_before_the_confidence(tmp_path):
    proposals = [proposal(1, 0.9), proposal(2, 0.9), proposal(3, 0.2), proposal(4, 0.2)]
    path = tmp_path / "review.json"
    path.write_text('{"format": "trifuse review 1", "objects": {"1": {"decision": "reject"}, "2": {"type": "Van"}, "3": {"decision": "accept"}}}')  # fmt: skip
    labels = reviewed(proposals, read_review(path), 0.5)
    assert [(one.number, one.kind) for one in labels] == [(2, "Van"), (3, "Car")]
    path.write_text('{"format": "trifuse review 1", "drive": "a", "objects": {}}')
    assert read_review(path, "a") == read_review(path) == {}
    with fault(LabelError, "review.json", "decisions on b", "some on a", "review these"):
        read_review(path, "b")
    with fault(LabelError, "review", "objects 1 to 4", "one on 9"):
        reviewed(proposals, {9: Decision("accept")}, 0.5)
    path.write_text('{"format": "trifuse review 1", "objects": {"2": {"type": "Cra"}}}')
    with fault(LabelError, "review.json object 2", "a type of Bicycle, Bus, Car, ", "Cra"):
        reviewed(proposals, read_review(path), 0.5)
    path.write_text('{"format": "trifuse review 1", "objects": [1]}')
    with fault(LabelError, "review.json", "objects by their numbers", "others"):
        read_review(path)
    path.write_text('{"format": "trifuse review 1", "objects": {"1": {"decision": "maybe"}}}')
    with fault(LabelError, "review.json object 1", "accept, reject", "'maybe'"):
        read_review(path)
    path.write_text("{")
    with fault(LabelError, "review.json", "decisions of a review", "no whole JSON"):
        read_review(path)


def test_the_file_of_proposals_is_read_as_it_was_written(tmp_path):
    poses = {0: np.eye(4), 1: np.eye(4)}
    poses[1][0, 3] = 2.5
    ProposalFile([proposal(1, 0.75)], poses, {0: "a", 1: "b"}).write(tmp_path)
    read = ProposalFile.read(tmp_path)
    assert read.names == {0: "a", 1: "b"}
    [one], first = read.proposals, proposal(1, 0.75)
    assert (one.kind, one.confidence, one.reasons) == ("Car", 0.75, ("few returns",))
    np.testing.assert_array_equal(one.boxes_world.size_m, first.boxes_world.size_m)
    np.testing.assert_array_equal(read.poses[1], poses[1])
    (tmp_path / "proposals.json").write_text('{"format": "trifuse proposals 1", "poses": {}}')
    with fault(LabelError, "proposals.json", "proposals", "'objects'", "trifuse label"):
        ProposalFile.read(tmp_path)


def test_unsure_proposals_are_learned_neither_as_objects_nor_as_background(tmp_path):
    proposals = [proposal(1, 0.9), proposal(2, 0.2), proposal(3, 0.9), proposal(4, 0.2)]
    poses = {0: np.eye(4), 1: np.eye(4)}
    poses[1][0, 3] = 2.5
    ProposalFile(proposals, poses, {0: "a", 1: "b"}).write(tmp_path)
    first = ProposedLabels(tmp_path)
    labels = first.at("b")
    assert labels.types.tolist() == ["Car", "Car", "DontCare", "DontCare"]
    assert labels.boxes_velo.bottom_m[0].tolist() == [-2.5, 0, 0]
    assert first.at("c") is None
    review = '{"format": "trifuse review 1", "objects": {"1": {"decision": "reject"}, "2": {"decision": "accept", "type": "Van"}}}'
    (tmp_path / "review.json").write_text(review)
    second = ProposedLabels(tmp_path)
    # What is rejected is background.
    assert second.at("a").types.tolist() == ["Van", "Car", "DontCare"]
    assert second.fingerprint != first.fingerprint
    # So is the box without returns of an object that is sure elsewhere.
    (tmp_path / "review.json").unlink()
    rare = replace(proposal(1, 0.9), points=np.array([0, 9]))
    ProposalFile([rare], poses, {0: "a", 1: "b"}).write(tmp_path)
    found = ProposedLabels(tmp_path)
    assert [found.at(name).types.tolist() for name in "ab"] == [["DontCare"], ["Car"]]
    ProposalFile(proposals, poses).write(tmp_path)
    with fault(LabelError, "proposals.json", "names of frames", "none", "trifuse label"):
        ProposedLabels(tmp_path)


def test_a_preview_shows_a_box_from_above_and_in_the_image():
    calibration = Calibration(
        cam_SE3_velo=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
        image_P_cam=np.array([[100.0, 0, 160, 0], [0, 100, 100, 0], [0, 0, 1, 0]]),
    )
    box = Boxes3D(np.array([[10.0, 0, -1]]), np.array([[4.0, 2, 2]]), np.zeros(1))
    points = np.array([[10.0, 0, 0.5, 0.2]], np.float32)
    image = np.full((200, 320, 3), 90, np.uint8)
    frame = Frame(index=0, points_velo=points, stamp_s=0.0, image=image, calibration=calibration)
    both = preview(frame, box)
    assert both.shape == (160, 320, 3)
    # The rectangle of the image is 25 px wide and 23 high; the crop has 80 px for 160.
    drawn = np.flatnonzero((both[80, 160:] == (255, 200, 0)).all(axis=1))
    assert drawn.tolist() == [55, 105]
    assert preview(replace(frame, image=None), box).shape == (160, 160, 3)
