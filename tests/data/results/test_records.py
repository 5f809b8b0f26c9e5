"""Dataclasses as lines of JSON, and back."""

from dataclasses import dataclass

import pytest

from data.results.documents import write_json
from data.results.records import FrameRecords, append_record, read_record, read_records
from perception.errors import LabelError, WriteError
from tests.faults import fault
from tests.full_disk import file_size_limit


@dataclass(frozen=True)
class Place:
    position_m: list[float]
    yaw_rad: float | None


@dataclass(frozen=True)
class Line:
    frame: int
    place: Place | None
    scores: dict[str, float | None]


LINES = [Line(0, Place([1.0, 2.0], 0.5), {"dm": None, "rm": 0.25}), Line(1, None, {})]


def test_what_is_written_is_read_back_after_every_line(tmp_path):
    path = tmp_path / "made" / "lines.jsonl"
    for count, line in enumerate(LINES, start=1):
        append_record(path, line)
        assert read_records(path, Line) == LINES[:count]


def test_a_full_disk_leaves_whole_lines(tmp_path):
    path = tmp_path / "lines.jsonl"
    for line in LINES:
        append_record(path, line)
    with file_size_limit(path.stat().st_size + 5), fault(WriteError, str(path)):
        append_record(path, LINES[0])
    assert read_records(path, Line) == LINES


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"frame": 1}', '{"frame": "x"}'])
def test_a_line_of_another_kind_is_named(tmp_path, text):
    path = tmp_path / "lines.jsonl"
    path.write_text(f'{{"frame": 1, "place": null, "scores": {{}}}}\n{text}\n')
    with pytest.raises(LabelError) as caught:
        read_records(path, Line)
    assert (caught.value.where, caught.value.expected) == (f"{path} line 2", "a Line")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(LabelError) as caught:
        read_records(tmp_path / "lines.jsonl", Line)
    assert caught.value.found == "no file"


def test_a_document_is_read_back(tmp_path):
    path = tmp_path / "place.json"
    write_json(path, Place([1.0, 2.0], float("nan")))
    assert read_record(path, Place) == Place([1.0, 2.0], None)


@pytest.mark.parametrize("text", ["", "[]", "{}"])
def test_a_damaged_document_is_refused(text, tmp_path):
    path = tmp_path / "place.json"
    path.write_text(text)
    with fault(LabelError, where=str(path), expected="a Place"):
        read_record(path, Place)


def test_records_of_frames_are_read_when_they_are_asked_for(tmp_path):
    path = tmp_path / "lines.jsonl"
    for line in LINES:
        append_record(path, line)
    records = FrameRecords(path, Line)
    assert list(records.items()) == [(0, LINES[0]), (1, LINES[1])]
    assert (len(records), 1 in records, 2 in records, records.get(7)) == (2, True, False, None)
    assert not FrameRecords(tmp_path / "none.jsonl", Line)


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"frame": "x"}'])
def test_a_line_without_a_frame_is_named(tmp_path, text):
    path = tmp_path / "lines.jsonl"
    path.write_text(f'{{"frame": 1, "place": null, "scores": {{}}}}\n{text}\n')
    with pytest.raises(LabelError) as caught:
        FrameRecords(path, Line)
    assert caught.value.where == f"{path} line 2"


def test_a_record_of_another_kind_is_named_by_its_frame(tmp_path):
    path = tmp_path / "lines.jsonl"
    path.write_text('{"frame": 4, "place": 3, "scores": {}}\n')
    with pytest.raises(LabelError) as caught:
        FrameRecords(path, Line)[4]
    assert (caught.value.where, caught.value.expected) == (f"{path} frame 4", "a Line")
