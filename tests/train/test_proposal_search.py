"""The search on a few frames with cars: what it chooses, and that it can be ended at any time."""

import json
from pathlib import Path

import pytest

from data.open_drive import open_drive
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.proposals import propose
from perception.errors import (
    CalibrationError,
    DriveError,
    LabelError,
    ScanError,
    UsageError,
)
from perception.maps.projection import camera_of
from tests.car_frames import write_car_frames
from tests.faults import fault
from train.proposal_search import search as searching
from train.proposal_search.counting import run_search_task
from train.proposal_search.grid import SearchGrid
from train.proposal_search.search import SearchConfig, search
from train.proposal_search.survey import survey

# With the first radius each column of points stands alone; the second keeps a car in one piece.
GRID = SearchGrid((0.4, 0.5), (0.01,), (2, 5), (0.05, 0.5))


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    return write_car_frames(tmp_path / "object")


@pytest.fixture
def config(frames: Path) -> SearchConfig:
    return SearchConfig(survey([frames], "Car"), GRID, "thesis", chunk_frames=3)


def rows(search_log: Path) -> list[str]:
    return search_log.read_text().splitlines()


def test_the_best_setting_has_the_highest_recall_with_fewest_proposals(config, tmp_path):
    table = search(config, tmp_path / "counts.jsonl")
    assert len(table) == len(GRID) == 8
    assert table[0].parameters.radius_m == 0.5
    assert (table[0].objects, table[0].frames, table[0].unread) == (8, 4, 0)
    assert table[0].reached == (8, 8)
    worth = [(-count.reached[0], count.proposals) for count in table]
    assert worth == sorted(worth)
    assert table[-1].reached[0] < 8


@pytest.mark.parametrize("method", ["default", "thesis"])
def test_sharing_the_ground_gives_the_same_proposals(frames, method):
    config = SearchConfig(survey([frames], "Car"), GRID, method, chunk_frames=4)
    for part in config.parts():
        for count in run_search_task(part):
            found = [
                propose(frame.points_velo, *camera_of(frame), count.parameters, method)
                for frame in open_drive(frames)
            ]
            assert count.proposals == sum(map(len, found)) > 0


def test_rows_are_one_a_setting_and_chunk(config, tmp_path):
    search_log = tmp_path / "made" / "counts.jsonl"
    table = search(config, search_log)
    header, *counts = map(json.loads, rows(search_log))
    assert header["search"]["of_class"] == "car"
    assert header["search"]["drives"][0]["labels"] == {"car": 8}
    assert len(counts) == 8 * 2  # four frames are a chunk of three and one of one
    best = [row for row in counts if ProposalConfig(**row["parameters"]) == table[0].parameters]
    assert [(row["chunk"], row["frames"], row["objects"]) for row in best] == [(0, 3, 6), (1, 1, 2)]


def test_two_workers_come_to_what_one_does(config, tmp_path):
    one = search(config, tmp_path / "one.jsonl", workers=1)
    two = search(config, tmp_path / "two.jsonl", workers=2)
    assert one == two
    assert sorted(rows(tmp_path / "one.jsonl")) == sorted(rows(tmp_path / "two.jsonl"))


def test_a_search_that_was_killed_goes_on_where_it_stopped(config, tmp_path, monkeypatch):
    whole = search(config, tmp_path / "whole.jsonl")
    search_log = tmp_path / "counts.jsonl"
    done = []

    def die_in_the_third_part(part):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(part)
        return run_search_task(part)

    monkeypatch.setattr(searching, "run_search_task", die_in_the_third_part)
    with pytest.raises(KeyboardInterrupt):
        search(config, search_log)
    assert len(rows(search_log)) == 1 + 2 * 4
    again = []

    def count_and_tell(part):
        again.append(part)
        return run_search_task(part)

    monkeypatch.setattr(searching, "run_search_task", count_and_tell)
    told = []
    table = search(
        config, search_log, progress=lambda finished, *told_now: told.append(told_now) or finished
    )
    assert table == whole
    assert len(again) == 2
    assert told == [(2, 4)]
    assert rows(search_log) == rows(tmp_path / "whole.jsonl")


@pytest.mark.parametrize("kept", [0.2, 0.5, 0.99])
def test_a_row_that_was_half_written_is_counted_again(config, tmp_path, kept):
    search_log = tmp_path / "counts.jsonl"
    whole = search(config, search_log)
    before = search_log.read_text()
    last = before.rstrip("\n").rpartition("\n")[2]
    search_log.write_text(before[: -len(last) - 1] + last[: int(kept * len(last))])
    assert search(config, search_log) == whole
    assert set(rows(search_log)) == set(before.splitlines())


def test_a_file_that_ends_in_its_first_row_is_written_again(config, tmp_path):
    search_log = tmp_path / "counts.jsonl"
    search_log.write_text('{"search": {"dri')
    assert search(config, search_log) == search(config, tmp_path / "other.jsonl")


def test_more_values_go_on_from_fewer(config, frames, tmp_path):
    search_log = tmp_path / "counts.jsonl"
    search(config, search_log)
    more = SearchGrid(GRID.cell_m, GRID.min_variance_m2, GRID.min_points, (0.05, 0.5, 0.6))
    wider = SearchConfig(config.survey, more, "thesis", chunk_frames=3)
    assert search(wider, search_log) == search(wider, tmp_path / "fresh.jsonl")


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"drive": True}, "drives"),
        ({"method": "default"}, "method"),
        ({"overlaps": (0.6,)}, "overlaps"),
        ({"chunk_frames": 2}, "chunk_frames"),
        ({"on_bad_frame": "skip"}, "on_bad_frame"),
    ],
)
def test_counts_of_another_search_are_refused(config, tmp_path, change, name):
    search_log = tmp_path / "counts.jsonl"
    search(config, search_log)
    before = search_log.read_bytes()
    found = config.survey
    if change.pop("drive", False):
        found = survey([write_car_frames(tmp_path / "other")], "Car")
    other = SearchConfig(found, GRID, **{"method": "thesis", "chunk_frames": 3, **change})
    with fault(UsageError, found=f"those of another, by its {name}", advice="choose"):
        search(other, search_log)
    assert search_log.read_bytes() == before


@pytest.mark.parametrize(
    "row",
    ['{"chunk": 0}', "no JSON", '{"chunk": 0, "parameters": {"cell_m": 0.5, "wheels": 4}}'],
)
def test_a_damaged_row_in_the_middle_is_named(config, tmp_path, row):
    search_log = tmp_path / "counts.jsonl"
    search(config, search_log)
    lines = rows(search_log)
    lines[2] = row
    search_log.write_text("\n".join(lines) + "\n")
    with fault(UsageError, "row 3", "the counts of one setting in one chunk"):
        search(config, search_log)


def test_a_file_of_another_kind_is_refused(config, tmp_path):
    search_log = tmp_path / "counts.jsonl"
    search_log.write_text("a diary\n")
    with fault(UsageError, expected="the counts of a search"):
        search(config, search_log)
    assert search_log.read_text() == "a diary\n"


def test_labels_without_objects_cannot_be_searched(tmp_path):
    empty = write_car_frames(tmp_path / "object", cars=0)
    with fault(LabelError, expected="at least one Car", found="no object"):
        survey([empty], "Car")


def test_an_unlabelled_class_is_an_error_that_names_the_labelled_ones(frames):
    with fault(LabelError, expected="at least one Tram", found="8 car"):
        survey([frames], "Tram")


def test_the_class_is_found_in_any_case(frames):
    assert survey([frames], "cAR").objects == (8,)


def test_a_drive_without_labels_is_refused(frames):
    for path in (frames / "training" / "label_2").iterdir():
        path.unlink()
    (frames / "training" / "label_2").rmdir()
    with fault(DriveError, expected="labels to search by", found="none"):
        survey([frames], "Car")


def test_a_drive_without_camera_is_refused(tmp_path):
    blind = write_car_frames(tmp_path / "object", camera=False)
    with fault(CalibrationError, found="none"):
        survey([blind], "Car")


def test_drives_are_searched_together_and_thinned(frames, tmp_path):
    other = write_car_frames(tmp_path / "other", frames=5)
    both = survey([frames, other], "Car", every=2)
    assert [drive.frames for drive in both.drives] == [(0, 2), (0, 2, 4)]
    assert both.objects == (4, 6)
    assert [chunk.frames for chunk in both.chunks(2)] == [(0, 2), (0, 2), (4,)]


@pytest.mark.parametrize(("twice", "every"), [(True, 1), (False, 0)])
def test_a_drive_named_twice_and_no_step_are_refused(frames, twice, every):
    with pytest.raises(UsageError):
        survey([frames, frames] if twice else [frames], "Car", every=every)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_damaged_scan_stops_the_search(frames, tmp_path, workers):
    (frames / "training" / "velodyne" / "000000.bin").write_bytes(b"12345")
    config = SearchConfig(survey([frames], "Car"), GRID, chunk_frames=4)
    with fault(ScanError, "000000.bin"):
        search(config, tmp_path / "counts.jsonl", workers)
    assert not (
        tmp_path / "counts.jsonl"
    ).exists()  # nothing is counted: the next search may differ


def test_a_damaged_scan_can_be_skipped(frames, tmp_path):
    (frames / "training" / "velodyne" / "000001.bin").write_bytes(b"12345")
    config = SearchConfig(survey([frames], "Car"), GRID, chunk_frames=2, on_bad_frame="skip")
    table = search(config, tmp_path / "counts.jsonl")
    assert {(count.frames, count.unread, count.objects) for count in table} == {(3, 1, 6)}


def test_without_a_frame_that_can_be_read_there_is_no_best(frames, tmp_path):
    for path in (frames / "training" / "velodyne").iterdir():
        path.write_bytes(b"12345")
    config = SearchConfig(survey([frames], "Car"), GRID, on_bad_frame="skip")
    with fault(LabelError, found="none, as 4 frames cannot be read"):
        search(config, tmp_path / "counts.jsonl")


@pytest.mark.parametrize(
    "values",
    [{"cell_m": ()}, {"cell_m": (0.5, 0.5)}, {"radius_m": (0.0,)}, {"min_points": (0,)}],
)
def test_values_that_cannot_work_are_refused(values):
    with pytest.raises(UsageError):
        SearchGrid(**values)


def test_the_default_grid_holds_the_thesis_values():
    grid = SearchGrid()
    assert len(grid) == 400
    assert ProposalConfig(0.5, 0.01, 5, 0.5) in grid.combinations()
