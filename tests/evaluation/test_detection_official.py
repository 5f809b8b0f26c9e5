"""The detection measure says what KITTI's own tool says, point by point and count by count."""

import json
import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data.kitti.detection_rows import read_detection_set, read_frame_list
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.evaluation_boxes import pair_boxes

_ORACLE = Path(__file__).parents[3] / "shared" / "oracle"
SETS = ("syn_car", "syn_3class", "fpointnet_val_half")
CASES = (
    *("few_gt", "gt_height_limits", "det_height_limits", "occlusion_truncation_limits"),
    *("neighbour_classes", "dontcare", "duplicates", "two_gt_one_det", "small_other_class"),
    *("class_never_detected", "iou_boundary", "equal_scores", "no_detection_at_all"),
    *("recall_sampling_41", "recall_sampling_80", "recall_sampling_97", "recall_sampling_400"),
    *("odd_values", "mixed"),
)


@dataclass(frozen=True)
class Official:
    """Boxes as texts, and what the tool says of them."""

    inputs: Path
    sets: dict[str, Any]
    cases: dict[str, Any]


@pytest.fixture(scope="module")
def official(tmp_path_factory: pytest.TempPathFactory) -> Official:
    if not (_ORACLE / "object_expected.json").is_file():
        pytest.skip(f"no figures of the benchmark's tool in {_ORACLE}")
    folder = tmp_path_factory.mktemp("official")
    with tarfile.open(_ORACLE / "object_inputs.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    sets, cases = (
        json.loads((_ORACLE / name).read_text())
        for name in ("object_expected.json", "object_micro_expected.json")
    )
    return Official(folder, sets, cases)


def test_no_set_and_no_case_is_left_out(official: Official):
    assert set(official.sets) == set(SETS)
    assert set(official.cases) == set(CASES)


@pytest.mark.parametrize("name", SETS)
def test_sets_have_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path, name: str
):
    labels, boxes = official.inputs / "object" / "labels.txt", official.inputs / "object" / name
    assert_same_figures(labels, boxes, official.sets[name]["classes"], tmp_path)


@pytest.mark.parametrize("name", CASES)
def test_cases_have_the_figures_of_the_benchmarks_tool(
    official: Official, tmp_path: Path, name: str
):
    boxes = official.inputs / "object_micro" / name
    assert_same_figures(boxes / "labels.txt", boxes, official.cases[name]["classes"], tmp_path)


def assert_same_figures(labels: Path, boxes: Path, expected: dict[str, Any], folder: Path) -> None:
    frames = read_frame_list(boxes / "frames.txt")
    write_frames(folder / "labels", frames, labels, "{}")
    row = "{} -1 -1 {} {} {} {} {} -1 -1 -1 -1000 -1000 -1000 -10 {}"
    write_frames(folder / "results", frames, boxes / "detections.txt", row)
    found = read_detection_set(folder / "results", folder / "labels", frames)

    metrics = kitti_average_precision(pair_boxes(found.truths, found.detections, len(frames)))

    for of_class, curves in metrics.items():
        of_tool = expected[of_class.name.lower()]
        assert list(curves) == list(of_tool or {})
        for difficulty, curve in curves.items():
            assert_same_curve(curve, of_tool[difficulty])


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
