"""What results are stands in them, not in their names."""

import json
from pathlib import Path

import pytest

from data.result_files import find_results
from perception.errors import UsageError
from tests.faults import fault

DETECTION = "Car -1 -1 -10 600 157 630 190 -1 -1 -1 -1000 -1000 -1000 -10 0.93"


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("000000.txt", DETECTION, "detections"),
        ("0000.txt", DETECTION, "detections"),
        ("000000.txt", f"0 1 {DETECTION}", "tracks"),
        ("0000.txt", f"\n-1 1 {DETECTION}", "tracks"),
        ("000000.txt", "1,1,100,150,80,60,0.9,-1,-1,-1", "tracks"),
        ("000000.txt", "", "detections"),
        ("0000.txt", "\n", "tracks"),
        ("0000.log", "", "detections"),
    ],
)
@pytest.mark.parametrize("inner", ["", "data"])
def test_texts(tmp_path: Path, name: str, text: str, kind: str, inner: str):
    folder = tmp_path / inner
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    found = find_results(tmp_path)
    assert (found.path, found.kind, found.form) == (folder, kind, "KITTI")


def test_the_first_file_with_a_row_tells(tmp_path: Path):
    (tmp_path / "000000.txt").write_text("")
    (tmp_path / "000001.txt").write_text(f"3 7 {DETECTION}")
    assert find_results(tmp_path).kind == "tracks"
    assert find_results(tmp_path, "detections").kind == "detections"


@pytest.mark.parametrize(
    ("document", "form", "kind"),
    [
        ([], "COCO", "detections"),
        ({"results": {"a": [], "b": [{"tracking_id": "7"}]}}, "nuScenes", "tracks"),
        ({"meta": {}, "results": {"a": [{"detection_name": "car"}]}}, "nuScenes", "detections"),
        ({"results": {}}, "nuScenes", "detections"),
    ],
)
def test_documents(tmp_path: Path, document: object, form: str, kind: str):
    path = tmp_path / "tracks.txt"
    path.write_text(json.dumps(document))
    found = find_results(path)
    assert (found.form, found.kind, found.document) == (form, kind, document)
    assert find_results(path, kind).kind == kind


def test_the_kind_of_a_document_cannot_be_another(tmp_path: Path):
    path = tmp_path / "found.json"
    path.write_text("[]")
    with fault(UsageError, "--kind tracks", f"detections, as {path} holds", "tracks"):
        find_results(path, "tracks")
    path.write_text('{"results": {"a": []}}')
    assert find_results(path, "tracks").kind == "tracks"
