"""Plain tracking rows: read as written, and refused in one sentence."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from data.kitti.tracking_rows import (
    TrackingRows,
    format_result_rows,
    read_label_rows,
    read_result_rows,
)
from perception.errors import LabelError, PerceptionError
from tests.faults import fault

LABEL = "3 4 Car 1 2 -1.5 10.25 20 30.5 40 1.5 1.8 4.2 -3 1.7 20 0.25"
RESULT = "3 4 Car -1 -1 -10 10.25 20 30.5 40 -1 -1 -1 -1000 -1000 -1000 -10 0.75"
ROWS = TrackingRows(
    frames=np.array([0, 2, 2]),
    ids=np.array([5, 5, -1]),
    types=np.array(["Pedestrian", "Cyclist", "DontCare"]),
    truncation=np.array([0.0, 1, -1]),
    occlusion=np.array([3.0, 0, -1]),
    alphas_rad=np.array([0.5, -1.25, -10]),
    boxes_px=np.arange(12.0).reshape(3, 4) + 0.125,
    sizes_hwl_m=np.arange(9.0).reshape(3, 3),
    bottoms_cam_m=-np.arange(9.0).reshape(3, 3),
    headings_rad=np.array([3.0, -3, -10]),
    scores=np.array([0.5, -2, 7]),
)


def write(folder: Path, text: str) -> Path:
    path = folder / "0000.txt"
    path.write_text(text)
    return path


def test_every_column_of_a_label_has_its_place(tmp_path):
    rows = read_label_rows(write(tmp_path, f"{LABEL}\n"))
    assert (rows.frames, rows.ids, rows.types) == (3, 4, "Car")
    assert (rows.truncation, rows.occlusion, rows.alphas_rad) == (1, 2, -1.5)
    assert rows.boxes_px.tolist() == [[10.25, 20, 30.5, 40]]
    assert rows.sizes_hwl_m.tolist() == [[1.5, 1.8, 4.2]]
    assert rows.bottoms_cam_m.tolist() == [[-3, 1.7, 20]]
    assert rows.headings_rad == 0.25
    assert np.isnan(rows.scores).all()


def test_a_result_has_a_score(tmp_path):
    rows = read_result_rows(write(tmp_path, f"\n{RESULT}\n\n"))
    assert rows.scores.tolist() == [0.75]
    assert rows.headings_rad.tolist() == [-10]


def without_scores(rows):
    return "\n".join(line.rpartition(" ")[0] for line in format_result_rows(rows).splitlines())


@pytest.mark.parametrize("kind", ["labels", "results"])
def test_rows_read_back_as_written(tmp_path, kind):
    has_scores = kind == "results"
    text = format_result_rows(ROWS) if has_scores else without_scores(ROWS)
    path = write(tmp_path, text)
    read = read_result_rows(path) if has_scores else read_label_rows(path)
    for field in fields(TrackingRows):
        if field.name != "scores" or has_scores:
            assert getattr(read, field.name).tolist() == getattr(ROWS, field.name).tolist()
    assert {len(line.split()) for line in text.splitlines()} == {18 if has_scores else 17}


def test_an_empty_file_holds_no_rows(tmp_path):
    for read in (read_label_rows, read_result_rows):
        rows = read(write(tmp_path, "\n"))
        assert len(rows) == 0
        assert rows.boxes_px.shape == (0, 4)
    assert format_result_rows(rows) == ""


@pytest.mark.parametrize(
    ("row", "expected", "found"),
    [
        (RESULT, "17 columns, frame to ry", "18"),
        ("1 2 Car", "17 columns, frame to ry", "3"),
        (LABEL.replace("3 4", "3.5 4"), "whole numbers before the type, as frame is", "'3.5'"),
        (LABEL.replace("3 4", f"3 {2**70}"), "whole numbers before the type, as id is", "'118"),
        (LABEL.replace("20", "wide"), "finite numbers after the type, as y1 is", "'wide'"),
        (LABEL.replace(" 0.25", " nan"), "finite numbers after the type, as ry is", "'nan'"),
        (LABEL.replace("40", "inf"), "finite numbers after the type, as y2 is", "'inf'"),
        (LABEL.replace("Car", "Bus"), "one of Car, Van", "'Bus'"),
        (LABEL.replace("3 4", "6 4"), "frames from 0 to 5", "'6'"),
        (LABEL.replace("3 4", "-1 4"), "frames from 0 to 5", "'-1'"),
        (LABEL.replace("Car", "car"), "every car once in a frame", "id 4 again in frame 3"),
    ],
)
def test_a_row_that_cannot_be_is_named_with_its_file(tmp_path, row, expected, found):
    path = write(tmp_path, f"{LABEL}\n{row}\n")
    with fault(LabelError, f"{path} row 2", expected, found):
        read_label_rows(path, frame_count=6)


def test_an_id_may_be_there_again_where_it_means_another(tmp_path):
    others = (LABEL.replace("Car", "Van"), LABEL.replace("3 4", "4 4"), LABEL)
    rows = read_label_rows(write(tmp_path, "\n".join(others)))
    assert len(rows) == 3
    loose = "\n".join([LABEL.replace("3 4", "3 -1")] * 2)
    assert len(read_label_rows(write(tmp_path, loose))) == 2


def test_without_a_length_any_frame_may_be():
    with fault(LabelError, expected="a label text", found="no file"):
        read_label_rows(Path("nowhere/0000.txt"))


def test_arrays_of_different_lengths_are_refused():
    values = {field.name: getattr(ROWS, field.name) for field in fields(TrackingRows)}
    with fault(PerceptionError, where="boxes_px", expected="shape (3, 4)"):
        TrackingRows(**{**values, "boxes_px": np.zeros((2, 4))})


def test_official_labels_are_written_as_they_were_read(kitti_root):
    official = kitti_root / "tracking/training/label_02/0000.txt"
    written = without_scores(read_label_rows(official, frame_count=154))
    assert written.splitlines() == official.read_text().splitlines()
