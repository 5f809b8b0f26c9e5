"""nuScenes' detection task: matches by distance, errors, NDS; equal to the devkit on a real scene."""

import json
import lzma
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.layouts import OpenConfig
from data.measured_task import measure_task_results
from data.nuscenes.samples import read_samples
from data.nuscenes.scene import open_scene
from data.result_files import find_results
from perception.evaluation.nuscenes.boxes import Racks, Surroundings, TaskDetections, TaskObjects
from perception.evaluation.nuscenes.precision import match_centers
from perception.evaluation.nuscenes.protocol import CLASSES, ERRORS
from perception.evaluation.nuscenes.report import SampleObjects, TaskMetrics, measure_task
from perception.evaluation.objects import LabelledView
from perception.types import Calibration, Float64

_SHARED = Path(__file__).parents[3] / "shared"
AROUND = Surroundings(np.zeros(2), Racks.empty())


def columns(places: list[tuple[float, float]], name: str) -> dict[str, Any]:
    count = len(places)
    return {
        "types": np.full(count, name),
        "centers_m": np.column_stack([np.array(places, float).reshape(-1, 2), np.zeros(count)]),
        "size_m": np.tile([4.0, 2.0, 1.5], (count, 1)),
        "yaw_rad": np.zeros(count),
        "velocities_m_s": np.zeros((count, 2)),
        "attributes": np.full(count, "vehicle.parked"),
    }


def objects(*places: tuple[float, float], name: str = "car") -> TaskObjects:
    return TaskObjects(**columns([*places], name), has_points=np.ones(len(places), bool))


def detections(*rows: tuple[float, float, float], name: str = "car") -> TaskDetections:
    """Return detections at x, y with a score."""
    scores = np.array([score for *_, score in rows], float)
    return TaskDetections(**columns([(x, y) for x, y, _ in rows], name), scores=scores)


def measured(*samples: tuple[TaskObjects, TaskDetections], name: str = "car", at: Surroundings = AROUND) -> TaskMetrics:  # fmt: skip
    report = measure_task("made up", [SampleObjects(*one, at) for one in samples])
    return report.classes[name]


def matches(truths: list[tuple[float, float]], found: list[tuple[float, float]]) -> list[list[int]]:
    """Return the matches in one sample at 0.5, 1, 2 and 4 m."""
    places: list[Float64] = [np.array(one, float).reshape(-1, 2) for one in (truths, found)]
    zeros = [np.zeros(len(one), np.int64) for one in places]
    table = match_centers(places[0], zeros[0], places[1], zeros[1])
    return [[int(one) for one in row] for row in table]


def test_the_best_detection_takes_the_nearest_object():
    found = matches([(10, 0), (12, 0)], [(11.2, 0), (12.1, 0), (10, 3)])
    # From 1 m on the first takes the object 0.8 m away, and leaves none to the second, whose other is 2.1 m away.
    assert found == [[-1, 1, -1], [1, -1, -1], [1, -1, -1], [1, 0, -1]]


def test_a_distance_equal_to_the_limit_is_no_match_and_the_first_of_equal_objects_is_taken():
    assert [one[0] for one in matches([(10, 0)], [(12, 0)])] == [-1, -1, -1, 0]
    assert [one[0] for one in matches([(10, 1), (10, -1)], [(10, 0)])] == [-1, -1, 0, 0]
    assert matches([], [(1, 1)]) == [[-1]] * 4
    assert matches([(1, 1)], []) == [[]] * 4


def test_samples_are_matched_by_themselves():
    truths_m, found_m = np.array([[0.0, 0], [5, 0], [0, 0]]), np.array([[0.0, 0], [0, 0], [0, 0], [5, 0]])  # fmt: skip
    found = match_centers(truths_m, np.array([0, 0, 2]), found_m, np.array([2, 1, 0, 0]))
    assert found.tolist() == [[2, -1, 0, 1]] * 4


def test_perfect_detections():
    truths = objects((10, 0), (20, 5), (-30, 1))
    car = measured((truths, detections((10, 0, 0.9), (20, 5, 0.8), (-30, 1, 0.7))))
    assert (car.objects, car.detections, car.mean_ap) == (3, 3, pytest.approx(1))
    assert list(car.errors.values()) == pytest.approx([0.0] * 5)


def test_false_detections_before_and_behind_the_true_ones():
    truths = objects((10, 0), (20, 0))
    behind = measured((truths, detections((10, 0, 0.9), (20, 0, 0.8), (0, 9, 0.7))))
    before = measured((truths, detections((10, 0, 0.8), (20, 0, 0.7), (0, 9, 0.9))))
    # At recall 1, of equal recalls the last one counts: precision 2/3.
    assert behind.mean_ap == pytest.approx((89 * 0.9 + 2 / 3 - 0.1) / 90 / 0.9)
    # Precision 1/2 at recall 1/2 and 2/3 at 1, between them on a line, below them on the line from 0 at the false one.
    recalls = np.linspace(0, 1, 101)
    precision = np.interp(recalls, [0, 0.5, 1], [0, 0.5, 2 / 3])
    assert before.mean_ap == pytest.approx((precision[11:] - 0.1).clip(0).mean() / 0.9)


def test_of_equal_scores_the_last_comes_first():
    truths = objects((10, 0))
    behind = (89 * 0.9 + 1 / 2 - 0.1) / 90 / 0.9
    one = measured((truths, detections((0, 9, 0.5), (10, 0, 0.5))))
    assert one.mean_ap == pytest.approx(behind)
    assert measured((truths, detections((10, 0, 0.5), (0, 9, 0.5)))).mean_ap < 0.5
    # Samples count in their order, too.
    empty = objects()
    first, last = (truths, detections((10, 0, 0.5))), (empty, detections((0, 9, 0.5)))
    assert measured(last, first).mean_ap == pytest.approx(behind)
    assert measured(first, last).mean_ap < 0.5


def test_classes_without_objects_or_detections():
    for truths, found in ((objects(), detections((1, 0, 0.5))), (objects((1, 0)), detections())):
        car = measured((truths, found))
        assert car.mean_ap == 0
        assert list(car.errors.values()) == [1.0] * 5
    report = measure_task("nothing", [])
    assert (report.mean_ap, report.nd_score) == (0, 0)
    cone, barrier = (report.classes[name].errors for name in ("traffic_cone", "barrier"))
    assert [math.isnan(cone[name]) for name in ERRORS] == [False, False, True, True, True]
    assert [math.isnan(barrier[name]) for name in ERRORS] == [False, False, False, True, True]
    assert "barrier: no labelled object, which counts as AP 0" in report.tables()[0].text()


def test_errors_are_1_up_to_a_recall_of_a_tenth():
    truths = objects(*((3 * n, 0) for n in range(10)))
    one = measured((truths, detections((0, 0.2, 0.9))))
    assert one.mean_ap == 0
    assert list(one.errors.values()) == [1.0] * 5
    two = measured((truths, detections((0, 0.2, 0.9), (3, 0.4, 0.8))))
    # The mean of the cumulative means from recall 0.11 to 0.2, from 0.2 m at 0.1 to 0.3 m at 0.2.
    assert two.trans_err == pytest.approx(np.linspace(0.21, 0.3, 10).mean())


def test_size_heading_velocity_and_attribute():
    truths = objects((10, 0))
    found = replace(
        detections((10, 0, 0.5)),
        size_m=np.array([[4.0, 1.0, 3.0]]),
        yaw_rad=np.array([np.pi + 0.25]),
        velocities_m_s=np.array([[3.0, 4.0]]),
        attributes=np.array(["vehicle.moving"]),
    )
    errors = measured((truths, found)).errors
    # 6 m³ in common of 12 and 12.
    assert list(errors.values()) == pytest.approx([0, 1 - 6 / 18, np.pi - 0.25, 5, 1])
    barriers = [replace(one, types=np.array(["barrier"])) for one in (truths, found)]
    assert measured((barriers[0], barriers[1]), name="barrier").orient_err == pytest.approx(0.25)
    unknown = replace(truths, attributes=np.array([""]), velocities_m_s=np.full((1, 2), np.nan))
    errors = measured((unknown, found)).errors
    assert (errors["vel_err"], errors["attr_err"]) == (1, 1)


def test_unknown_velocities_are_left_out():
    truths = objects((0, 0), (9, 0))
    truths.velocities_m_s[:] = [[np.nan, np.nan], [2, 0]]
    car = measured((truths, detections((0, 0, 0.9), (9, 0, 0.8))))
    # 0 before the first that is known, up to recall 0.5; from there on towards 2 m/s at recall 1.
    scores = np.interp(np.linspace(0, 1, 101), [0.5, 1], [0.9, 0.8])
    assert car.vel_err == pytest.approx(np.interp(-scores, [-0.9, -0.8], [0, 2])[11:].mean())


def test_what_counts():
    far = measured((objects((49.9, 0), (0, 50)), detections((49.9, 0, 0.9), (0, 50, 0.8))))
    assert (far.objects, far.detections) == (1, 1)
    moved = Surroundings(np.array([0.0, 30.0]), Racks.empty())
    assert measured((objects((0, 50)), detections()), at=moved).objects == 1
    hidden = replace(objects((5, 0), (9, 0)), has_points=np.array([False, True]))
    assert measured((hidden, detections((5, 0, 0.5)))).objects == 1
    other = measured((objects((5, 0), name=""), detections((5, 0, 0.5), name="")))
    assert (other.objects, other.detections) == (0, 0)
    assert [CLASSES[name].max_distance_m for name in ("bus", "bicycle", "barrier")] == [50, 40, 30]


def test_detections_beside_the_labelled_image_do_not_count():
    # 200 x 100 px, 45 degrees to either side of x; the box of the columns is 4 x 2 m.
    image_P_cam = np.array([[100.0, 0, 100, 0], [0, 100, 50, 0], [0, 0, 1, 0]])
    cam_SE3_world = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    dont_care_px = np.array([[140.0, 0, 160, 100]])  # around x, y = 20, -10
    view = LabelledView(Calibration(image_P_cam, cam_SE3_world), (200, 100), dont_care_px)
    truths = objects((20, 0), (10, 10.5))
    found = [
        (20, 0, 0.4),  # true
        (10, 10.6, 0.9),  # true: its centre is beside the image, as that of its object
        (10, -10.5, 0.95),  # false, but only a part of it is in the image
        (20, -10, 0.95),  # false, in a DontCare region
        (-20, 0, 0.99),  # behind
        (10, 20, 0.99),  # beside
    ]
    at = Surroundings(np.zeros(2), Racks.empty(), view)
    one = measured((truths, detections(*found)), at=at)
    assert (one.objects, one.detections, one.mean_ap) == (2, 4, pytest.approx(1))
    assert measured((truths, detections(*found))).mean_ap < 0.5
    # In the image a false detection counts.
    one = measured((truths, detections(*found, (20, 5, 0.95))), at=at)
    assert one.mean_ap == pytest.approx(
        measured((truths, detections(*found[:2], (20, 5, 0.95)))).mean_ap
    )
    assert one.mean_ap < 0.6


def test_bicycles_in_a_rack_do_not_count():
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # its length lies along y
    rack = Racks(np.array([[5.0, 0, 0]]), np.array([[6.0, 2, 2]]), turned[None])
    at = Surroundings(np.zeros(2), rack)
    for name, counted in (("bicycle", 2), ("motorcycle", 2), ("car", 4)):
        truths = objects((5, 2.9), (5, 3.1), (6.1, 0), (5.9, 0), name=name)
        found = detections((5, 2.9, 0.5), (5, 3.1, 0.5), (6.1, 0, 0.5), (5.9, 0, 0.5), name=name)
        one = measured((truths, found), name=name, at=at)
        assert (one.objects, one.detections) == (counted, counted)


def test_the_score_is_mean_precision_and_errors():
    truths, found = objects((10, 0)), detections((10, 0.5, 0.9))
    report = measure_task("made up", [SampleObjects(truths, found, AROUND)])
    assert report.classes["car"].ap_by_distance == {"0.5": 0, "1.0": pytest.approx(1), "2.0": pytest.approx(1), "4.0": pytest.approx(1)}  # fmt: skip
    assert report.mean_ap == pytest.approx(0.075)
    errors = dict(zip(ERRORS, (9.5 / 10, 0.9, 8 / 9, 7 / 8, 7 / 8), strict=True))
    assert report.tp_errors == pytest.approx(errors)
    scores = sum(1 - one for one in errors.values())
    assert report.nd_score == pytest.approx((5 * 0.075 + scores) / 10)
    (panel,) = report.panels()
    assert panel.title == "car, 1 objects"


# --- the devkit -----------------------------------------------------------------------------------


def test_a_real_scene_has_the_devkits_values(nuscenes_tables, tmp_path):
    folder = _SHARED / "oracle" / "nuscenes"
    if not folder.is_dir():
        pytest.skip("no shared results of nuscenes-devkit beside the checkout")
    path = tmp_path / "results.json"
    path.write_bytes(lzma.decompress((folder / "results_0916.json.xz").read_bytes()))
    heading, report, _ = measure_task_results(find_results(path), nuscenes_tables)
    assert heading == f"{path}: scene-0916, 41 samples all round"
    expected = json.loads((folder / "expected_0916.json").read_text())
    assert report.mean_ap == pytest.approx(expected["mean_ap"], abs=1e-9)
    assert report.nd_score == pytest.approx(expected["nd_score"], abs=1e-9)
    assert report.tp_errors == pytest.approx(expected["tp_errors"], abs=1e-9)
    for name, one in expected["classes"].items():
        ours = report.classes[name]
        assert (ours.objects, ours.detections) == (one["objects"], one["detections"]), name
        assert ours.ap_by_distance == pytest.approx(one["AP"], abs=1e-9), name
        errors = {key: float("nan") if one[key] is None else one[key] for key in ERRORS}
        assert ours.errors == pytest.approx(errors, abs=1e-9, nan_ok=True), name


def test_labels_as_results_are_perfect_but_for_attributes(nuscenes_tables):
    samples = read_samples(open_scene(nuscenes_tables, "scene-0916", OpenConfig(images=False)))
    perfect = []
    for one in samples:
        seen = one.truths[one.truths.has_points]
        known = {name: getattr(seen, name) for name in columns([], "car")}
        found = TaskDetections(**known, scores=np.ones(len(seen)))
        perfect.append(SampleObjects(one.truths, found, one.surroundings))
    report = measure_task("perfect", perfect)
    known = [one for one in report.classes.values() if one.objects]
    assert len(known) == 6
    for one in known:
        assert one.mean_ap == pytest.approx(1)
        assert max(list(one.errors.values())[:4]) < 1e-9
