"""Tables of a run, read back by Arrow and DuckDB."""

from dataclasses import replace
from pathlib import Path

import duckdb
import numpy as np
import pytest
from pyarrow import parquet

from data.exports import table_writer
from data.exports.table_schema import TABLES
from data.exports.table_writer import TableWriter
from data.results.result_writer import open_writers
from perception.errors import LabelError, WriteError
from perception.types import Tracks
from tests.faults import fault
from tests.full_disk import file_size_limit
from tests.known_result import TRACKS, known_result

DOCUMENT = Path(__file__).parents[3] / "docs/tables.md"


def write(out, results, min_vehicle_score=0.05):
    with open_writers([TableWriter(out, min_vehicle_score)]) as (writer,):
        for result in results:
            writer.add(result, None)


@pytest.fixture
def tables(tmp_path):
    """Return the folder of the tables of a drive of three frames, without tracks in the second."""
    results = [known_result(index) for index in range(3)]
    results[1] = replace(results[1], tracks=Tracks.empty(), vehicles=None)
    write(tmp_path, results, min_vehicle_score=0.0)
    return tmp_path / "tables"


def rows_of(tables, name):
    return parquet.read_table(tables / f"{name}.parquet").to_pylist()


def test_columns_are_those_of_the_schema(tables):
    assert {path.stem for path in tables.iterdir()} == set(TABLES)
    for name, columns in TABLES.items():
        schema = parquet.read_schema(tables / f"{name}.parquet")
        assert {field.name: str(field.type) for field in schema} == {
            column: one.type for column, one in columns.items()
        }
        described = {field.name: field.metadata[b"description"].decode() for field in schema}
        assert described == {column: one.description for column, one in columns.items()}


def test_frames_count_what_the_other_tables_list(tables):
    rows = rows_of(tables, "frames")
    assert rows[0] == {
        "frame": 0, "timestamp_ns": 0, "name": "000000", "number": 0, "has_image": True,
        "points": 3, "invalid_points": 0, "outside_points": 0, "ground_points": 1,
        "static_points": 1, "moving_points": 1, "static_voxels": 1, "moving_voxels": 1,
        "tracks": 2, "vehicles": 2, "latency_s": 0.007, "health": "OK", "findings": None,
    }  # fmt: skip
    assert [row["timestamp_ns"] for row in rows] == [0, 100_000_000, 200_000_000]
    assert [(row["tracks"], row["vehicles"]) for row in rows] == [(2, 2), (0, None), (2, 2)]


def test_tracks_are_those_of_the_pipeline_in_both_frames_of_reference(tables):
    rows = rows_of(tables, "tracks")
    assert [(row["frame"], row["track_id"]) for row in rows] == [(0, 4), (0, 9), (2, 4), (2, 9)]
    van, walker = rows[2:]
    assert (van["category"], van["score"], van["is_observed"]) == ("Van", 0.8125, True)
    assert [van[f"{name}_m"] for name in ("length", "width", "height")] == [4.2, 1.8, 1.5]
    assert [van[f"{axis}_velo_m"] for axis in "xyz"] == TRACKS.boxes.bottom_m[0].tolist()
    assert [van[f"{axis}_world_m"] for axis in "xyz"] == pytest.approx([98, 60, 1.3])
    assert (van["vx_velo_m_s"], van["vy_velo_m_s"], van["speed_m_s"]) == (3, 4, 5)
    assert (van["vx_world_m_s"], van["vy_world_m_s"]) == pytest.approx((-4, 3))
    assert (van["yaw_velo_rad"], van["yaw_world_rad"]) == pytest.approx((0, np.pi / 2))
    deviations = [van[f"std_{name}"] for name in ("x_velo_m", "vy_velo_m_s")]
    assert deviations == pytest.approx([0.2, 0.4])
    assert walker["category"] is walker["score"] is walker["std_x_velo_m"] is None
    assert walker["is_observed"] is False
    # 3 rad and a quarter turn are more than half a turn.
    assert walker["yaw_world_rad"] == pytest.approx(3 - 1.5 * np.pi)


def test_vehicles_keep_what_is_not_known_as_null(tables):
    car, faint, *_ = rows_of(tables, "vehicles")
    scores = [car[f"score_{modality}"] for modality in ("rgb", "dm", "rm")]
    assert scores == [0.75, 0.5, None]
    assert (car["points"], car["distance_m"], car["dominant_modality"]) == (2, 8.5, "rgb")
    assert [car[f"{edge}_px"] for edge in ("x1", "y1", "x2", "y2")] == [500, 150, 620.25, 240]
    assert (faint["track_id"], faint["x_velo_m"], faint["speed_m_s"]) == (None, None, None)
    assert (faint["score_rgb"], faint["score_dm"], faint["points"]) == (None, 0.25, 0)


def test_faint_vehicles_and_rectangles_without_a_camera_are_left_out(tmp_path):
    result = known_result()
    write(tmp_path, [replace(result, frame=replace(result.frame, image=None, calibration=None))])
    (car,) = rows_of(tmp_path / "tables", "vehicles")
    assert (car["score"], car["x1_px"]) == (0.875, None)


def test_poses_turn_the_lidar_into_the_world(tables):
    row = rows_of(tables, "poses")[0]
    assert [row[f"t{axis}_m"] for axis in "xyz"] == [100, 50, 3]
    half = np.sqrt(0.5)
    assert [row[f"q{axis}"] for axis in "wxyz"] == pytest.approx([half, 0, 0, half])


def test_timings_are_one_row_a_stage_and_name_what_was_skipped(tables):
    ground, fusion, skipped = rows_of(tables, "timings")[:3]
    assert (ground["stage"], ground["worker"], ground["start_s"]) == ("ground", "lidar", 0.001)
    assert (fusion["duration_s"], fusion["is_skipped"]) == (0.002, False)
    assert (skipped["stage"], skipped["duration_s"], skipped["is_skipped"]) == (
        "DepthCN",
        None,
        True,
    )


def test_duckdb_joins_the_tables(tables):
    query = f"""
        select track_id, count(*), max(speed_m_s), sum(duration_s)
        from '{tables}/tracks.parquet'
        join '{tables}/timings.parquet' using (frame)
        where not is_skipped group by track_id order by track_id
    """
    assert duckdb.sql(query).fetchall() == [
        (4, 4, 5.0, pytest.approx(0.014)),
        (9, 4, 1.0, pytest.approx(0.014)),
    ]


def test_rows_leave_memory_in_groups(tmp_path, monkeypatch):
    monkeypatch.setattr(table_writer, "_GROUP_FRAMES", 2)
    write(tmp_path, [known_result(index) for index in range(5)])
    file = parquet.ParquetFile(tmp_path / "tables/tracks.parquet")
    groups = [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)]
    assert groups == [4, 4, 2]


def test_a_run_that_fails_keeps_the_frames_that_were_done(tmp_path):
    with pytest.raises(RuntimeError), open_writers([TableWriter(tmp_path, 0.0)]) as (writer,):
        writer.add(known_result(0), None)
        raise RuntimeError
    assert len(rows_of(tmp_path / "tables", "tracks")) == 2
    assert {path.stem for path in (tmp_path / "tables").iterdir()} == set(TABLES)


def test_a_run_that_was_killed_behind_its_last_frame_keeps_its_tables(tmp_path):
    with open_writers([TableWriter(tmp_path, 0.0)]) as (writer,):
        writer.add(known_result(0), None)
        snapshot = writer.snapshot()
        writer.add(known_result(1), None)
    files = {path: path.read_bytes() for path in (tmp_path / "tables").iterdir()}
    with open_writers([TableWriter(tmp_path, 0.0)]) as (writer,):
        writer.restore(snapshot)
        writer.add(known_result(1), None)
    assert {path: path.read_bytes() for path in (tmp_path / "tables").iterdir()} == files


def test_a_run_whose_rows_are_gone_cannot_go_on(tmp_path):
    with pytest.raises(RuntimeError), open_writers([TableWriter(tmp_path, 0.0)]) as (writer,):
        writer.add(known_result(0), None)
        snapshot = writer.snapshot()
        raise RuntimeError
    for path in (tmp_path / "tables").iterdir():
        path.unlink()
    with (
        fault(LabelError, ".part.arrows", found="0 bytes", advice="--overwrite"),
        open_writers([TableWriter(tmp_path, 0.0)]) as (writer,),
    ):
        writer.restore(snapshot)


def test_a_full_disk_leaves_no_half_table(tmp_path):
    results = [known_result(index) for index in range(3)]
    with file_size_limit(2_000), pytest.raises(WriteError):
        write(tmp_path, results)
    for path in (tmp_path / "tables").iterdir():
        parquet.read_table(path)


def test_the_document_shows_the_schema():
    shown = [
        f"| `{name}` | {column.type} | {column.description} |"
        for columns in TABLES.values()
        for name, column in columns.items()
    ]
    lines = DOCUMENT.read_text().splitlines()
    assert [line for line in lines if line.startswith("| `")] == shown
    assert [line for line in lines if line.startswith("## ")] == [f"## {name}" for name in TABLES]
