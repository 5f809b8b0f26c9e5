"""The detection measure says what KITTI's own tool says, point by point and count by count."""

import json
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.kitti.detection_rows import DetectionSet, read_detection_set, read_frame_list
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.evaluation_boxes import EvaluationBoxes, pair_boxes
from perception.evaluation.detection.overlap_metric import BEV, IMAGE, SPACE
from perception.evaluation.detection.protocol import KITTI_CLASSES

_ORACLE = Path(__file__).parents[3] / "shared" / "oracle"
SETS = ("syn_car", "syn_3class", "fpointnet_val_half")
CASES = (
    *("few_gt", "gt_height_limits", "det_height_limits", "occlusion_truncation_limits"),
    *("neighbour_classes", "dontcare", "duplicates", "two_gt_one_det", "small_other_class"),
    *("class_never_detected", "iou_boundary", "equal_scores", "no_detection_at_all"),
    *("recall_sampling_41", "recall_sampling_80", "recall_sampling_97", "recall_sampling_400"),
    *("odd_values", "mixed"),
)
CASES_3D = (
    *(
        "yaw_wrap",
        "rotated_iou",
        "height_overlap",
        "stacked_boxes",
        "neighbour_classes",
        "dontcare",
    ),
    *("truncation_occlusion_limits", "height_limits_2d", "empty_results", "equal_scores"),
    *("no_2d_box", "no_3d_box"),
)
# Names of the tool's measures: metric, and whether it takes the loose overlaps.
MEASURES = {
    "image": (IMAGE, False),
    "ground": (BEV, False),
    "box3d": (SPACE, False),
    "ground_loose": (BEV, True),
    "box3d_loose": (SPACE, True),
}
RESULT_ROW = "{} -1 -1 {} {} {} {} {} -1 -1 -1 -1000 -1000 -1000 -10 {}"
RESULT_ROW_3D = "{} -1 -1" + 13 * " {}"


@dataclass(frozen=True)
class Official:
    """Boxes as texts, and what the tool says of them."""

    inputs: Path
    sets: dict[str, Any]
    cases: dict[str, Any]
    set_3d: dict[str, Any]
    cases_3d: dict[str, Any]


@pytest.fixture(scope="module")
def official(tmp_path_factory: pytest.TempPathFactory) -> Official:
    if not (_ORACLE / "object_3d_expected.json").is_file():
        pytest.skip(f"no figures of the benchmark's tool in {_ORACLE}")
    folder = tmp_path_factory.mktemp("official")
    for name in ("object_inputs.tar.xz", "object_3d_inputs.tar.xz"):
        with tarfile.open(_ORACLE / name) as archive:
            archive.extractall(folder, filter="data")
    sets, cases, of_3d = (
        json.loads((_ORACLE / name).read_text())
        for name in (
            "object_expected.json",
            "object_micro_expected.json",
            "object_3d_expected.json",
        )
    )
    return Official(folder, sets, cases, of_3d["object_3d"]["syn_3d"], of_3d["object_3d_micro"])


def test_no_set_and_no_case_is_left_out(official: Official):
    assert set(official.sets) == set(SETS)
    assert set(official.cases) == set(CASES)
    assert set(official.cases_3d) == set(CASES_3D)


@pytest.mark.parametrize("name", SETS)
def test_sets_have_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path, name: str
):
    labels, boxes = official.inputs / "object" / "labels.txt", official.inputs / "object" / name
    found = read_set(labels, boxes, RESULT_ROW, tmp_path)
    assert_same_image_figures(found, official.sets[name]["classes"])


@pytest.mark.parametrize("name", CASES)
def test_cases_have_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path, name: str
):
    boxes = official.inputs / "object_micro" / name
    found = read_set(boxes / "labels.txt", boxes, RESULT_ROW, tmp_path)
    assert_same_image_figures(found, official.cases[name]["classes"])


def test_the_set_of_3d_boxes_has_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path
):
    folder = official.inputs / "object_3d"
    found = read_set(folder / "labels.txt", folder / "syn_3d", RESULT_ROW_3D, tmp_path)
    assert_same_figures(found, official.set_3d["classes"])


@pytest.mark.parametrize("name", CASES_3D)
def test_cases_of_3d_boxes_have_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path, name: str
):
    boxes, expected = official.inputs / "object_3d_micro" / name, official.cases_3d[name]
    found = read_set(boxes / "labels.txt", boxes, RESULT_ROW_3D, tmp_path)
    assert_same_figures(found, expected["classes"])
    assert_same_overlaps(found, expected["overlaps"])


def read_set(labels: Path, boxes: Path, row: str, folder: Path) -> DetectionSet:
    frames = read_frame_list(boxes / "frames.txt")
    write_frames(folder / "labels", frames, labels, "{}")
    write_frames(folder / "results", frames, boxes / "detections.txt", row)
    return read_detection_set(folder / "results", folder / "labels", frames)


def assert_same_image_figures(found: DetectionSet, expected: dict[str, Any]) -> None:
    metrics = kitti_average_precision(pairs_of(found))
    for of_class, curves in metrics.items():
        of_tool = expected[of_class.name.lower()]
        assert list(curves) == list(of_tool or {})
        for difficulty, curve in curves.items():
            assert_same_curve(curve, of_tool[difficulty])


def assert_same_figures(found: DetectionSet, expected: dict[str, Any]) -> None:
    """Compare every measure; the tool has none of a class that is nowhere, and none of a class without such boxes."""
    for name, (metric, is_loose) in MEASURES.items():
        classes = [c.at_iou(c.loose_iou) if is_loose else c for c in KITTI_CLASSES]
        for of_class, curves in kitti_average_precision(pairs_of(found, metric), classes).items():
            by_level = expected[of_class.name.lower()] or {}
            of_tool = {level: one[name] for level, one in by_level.items() if one[name]}
            assert list(curves) == list(of_tool), name
            for level, curve in curves.items():
                assert_same_curve(curve, of_tool[level])


def assert_same_overlaps(found: DetectionSet, expected: list[list[Any]]) -> None:
    """Compare rows of frame, line of the label, line of the detection, overlap from above and in space."""
    of_tool = {
        (str(frame), truth, detection): overlaps for frame, truth, detection, *overlaps in expected
    }
    for column, metric in enumerate((BEV, SPACE)):
        boxes = pairs_of(found, metric)
        overlaps = {}
        for truth, detection, iou in zip(*vars(boxes.overlaps).values(), strict=True):
            place = boxes.truths.frames[truth]
            first = np.searchsorted(boxes.truths.frames, place)
            first_found = np.searchsorted(boxes.detections.frames, place)
            overlaps[found.numbers[place], truth - first, detection - first_found] = iou
        for (frame, truth, detection), pair in of_tool.items():
            ours = overlaps.pop((int(frame), truth, detection), 0.0)
            assert ours == pytest.approx(pair[column], abs=1e-6)
        assert max(overlaps.values(), default=0) < 1e-6


def pairs_of(found: DetectionSet, metric: Any = IMAGE) -> EvaluationBoxes:
    return pair_boxes(found.truths, found.detections, len(found.numbers), metric)


def write_frames(folder: Path, frames: tuple[int, ...], rows: Path, row: str) -> None:
    """Write a text a frame, from one text whose rows begin with the frame."""
    texts = {frame: [] for frame in frames}
    for frame, *words in map(str.split, rows.read_text().splitlines()):
        if int(frame) in texts:
            texts[int(frame)].append(" ".join(words) if row == "{}" else row.format(*words))
    folder.mkdir()
    for frame, lines in texts.items():
        (folder / f"{frame:06d}.txt").write_text("\n".join(lines))


def assert_same_curve(curve: Any, expected: dict[str, Any]) -> None:
    counts = expected["debug"]
    assert (curve.truths, curve.matches) == (counts["n_gt"], counts["n_scores"])
    np.testing.assert_allclose(curve.thresholds, counts["score_thresholds"], atol=1e-6, rtol=0)
    assert curve.true_positives.tolist() == counts["tp"]
    assert curve.false_positives.tolist() == counts["fp"]
    assert curve.false_negatives.tolist() == counts["fn"]
    np.testing.assert_allclose(curve.precision, expected["precision"], atol=2e-6, rtol=0)
    assert curve.ap(11) == pytest.approx(expected["ap_r11"], abs=1e-4)
    assert curve.ap(40) == pytest.approx(expected["ap_r40"], abs=1e-4)
    if "aos_r40" not in expected:
        assert curve.orientation_similarity is None
        assert curve.aos() is None
        return
    similarity = expected["orientation_similarity"]
    np.testing.assert_allclose(curve.orientation_similarity, similarity, atol=2e-6, rtol=0)
    assert curve.aos(11) == pytest.approx(expected["aos_r11"], abs=1e-4)
    assert curve.aos(40) == pytest.approx(expected["aos_r40"], abs=1e-4)
