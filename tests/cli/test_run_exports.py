"""What a run exports by its flags."""

import duckdb
import pytest
import yaml
from rerun.chunk import RrdReader

from data.results.run_folder import RunFolder
from perception.errors import WriteError
from tests.faults import command, fault

FRAMES = 2


@pytest.fixture(scope="module")
def exported(street, tmp_path_factory):
    """Return the folder of a run with its tables, and its recording."""
    out = tmp_path_factory.mktemp("exports")
    words = ["--no-video", "--no-report", "--pipeline.no-parallel", "--frames", FRAMES]
    command("run", street, "--out", out / "run", "--tables", "--rerun", out / "run.rrd", *words)
    return out / "run", out / "run.rrd"


def test_tables_hold_what_the_lines_hold(exported):
    folder = RunFolder(exported[0])
    tracks = duckdb.sql(
        f"select frame, track_id, x_velo_m from '{exported[0]}/tables/tracks.parquet'"
    )
    lines = [
        (line.frame, track.id, pytest.approx(track.velo.position_m[0], abs=1e-4))
        for line in folder.tracks().values()
        for track in line.tracks
    ]
    assert tracks.fetchall() == lines
    vehicles = duckdb.sql(
        f"select vehicles from '{exported[0]}/tables/frames.parquet' order by frame"
    )
    assert [count for (count,) in vehicles.fetchall()] == [one.vehicles for one in folder.frames()]


def test_a_recording_holds_every_point(exported):
    folder = RunFolder(exported[0])
    points = [
        len(positions)
        for chunk in RrdReader(exported[1]).stream()
        if chunk.entity_path == "/world/ego/lidar/ground"
        for positions in chunk.to_record_batch().column("Points3D:positions").to_pylist()
    ]
    assert points == [one.points["ground"] for one in folder.frames()]


def test_the_configuration_names_the_tables_but_no_place_of_a_recording(exported):
    config = yaml.safe_load((exported[0] / "config.yaml").read_text())
    assert config["tables"] is True
    assert not {"rerun", "view"} & config.keys()


def test_a_recording_that_cannot_be_written_is_named_before_the_run(tmp_path):
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "x.rrd"
    with fault(WriteError, where=str(path), found="Not a directory"):
        command("run", "nowhere", "--rerun", path)
