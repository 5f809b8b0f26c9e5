"""What a run leaves behind, whole runs and broken ones."""

import json
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest
import yaml

from data.kitti.tracking_rows import read_result_rows
from data.open_drive import open_drive
from data.results.run_folder import RunFolder
from perception.cli.main import main
from perception.errors import DriveError, ScanError, UsageError
from tests.faults import command, fault

FRAMES = 4  # of `street`
ROOT = Path(__file__).parents[2]
# What a run leaves behind is the same with its stages one after another.
IN_TURN = "--pipeline.no-parallel"


@pytest.fixture(scope="module")
def results(street, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("results")
    assert main(["run", str(street), "--out", str(out)]) == 0
    return out


@pytest.fixture
def damaged(street, tmp_path) -> Path:
    """Return a drive whose third scan is cut off."""
    copy = tmp_path / street.parent.name / street.name
    copy.parent.mkdir()
    for source in street.parent.rglob("*"):
        if source.is_file():
            target = copy.parent / source.relative_to(street.parent)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(source.read_bytes())
    scan = copy / "velodyne_points/data/0000000002.bin"
    scan.write_bytes(scan.read_bytes()[:1001])
    return copy


def frames_of(video: Path) -> int:
    with av.open(str(video)) as container:
        return sum(1 for _ in container.decode(video=0))


def test_every_file_of_a_run_is_there(results):
    names = {path.name for path in results.iterdir()}
    assert names == {
        "config.yaml", "data", "frames.jsonl", "poses.txt", "labels", "obstacles", "preview.jpg",
        "report.html", "report.json", "summary.json", "timeline.png", "tracks", "tracks.jsonl", "vehicles", "vehicles.jsonl",
        "video.mp4",
    }  # fmt: skip
    assert frames_of(results / "video.mp4") == FRAMES


def test_labels_say_what_the_frame_lines_count(results, street):
    lines = [json.loads(line) for line in (results / "frames.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == list(range(FRAMES))
    drive = open_drive(street, images=False)
    for line in lines:
        labels = np.fromfile(results / f"labels/{line['frame']:06d}.label", np.uint32)
        assert len(labels) == len(drive[line["frame"]].points_velo)
        assert np.count_nonzero(labels == 40) == line["points"]["ground"] > 30_000
        assert np.count_nonzero(labels == 251) == line["points"]["moving"]


def test_tracks_are_written_for_every_frame_and_as_benchmark_rows(results, street):
    lines = [json.loads(line) for line in (results / "tracks.jsonl").read_text().splitlines()]
    frames = [json.loads(line) for line in (results / "frames.jsonl").read_text().splitlines()]
    assert [line["frame"] for line in lines] == list(range(FRAMES))
    assert [len(line["tracks"]) for line in lines] == [frame["tracks"] for frame in frames]
    ids = {track["id"] for line in lines for track in line["tracks"]}
    assert json.loads((results / "summary.json").read_text())["tracks"]["ids"] == len(ids)
    rows = read_result_rows(results / "tracks" / f"{open_drive(street).name}.txt", FRAMES)
    assert set(rows.ids.tolist()) <= ids


def test_poses_are_where_the_drive_was(results, street):
    poses = np.loadtxt(results / "poses.txt").reshape(-1, 3, 4)
    truth = np.loadtxt(street / "truth_poses.txt").reshape(-1, 3, 4)
    travelled = poses[-1, :, 3] - poses[0, :, 3]
    assert np.linalg.norm(travelled - (truth[-1, :, 3] - truth[0, :, 3])) < 0.1


def test_the_written_configuration_is_the_effective_one(results, street):
    config = yaml.safe_load((results / "config.yaml").read_text())
    assert (config["drive"], config["frames"]) == (str(street), None)
    assert "out" not in config
    assert config["pipeline"]["motion"]["previous_scans"] == 6
    assert config["pipeline"]["ego_vehicle"]["front_m"] == 3.0
    # What is left to the sensor stays so: 30 m of dense scans.
    assert config["pipeline"]["area"]["ahead_m"] is None


def test_the_written_configuration_can_be_given_back(street, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    words = ["--frames", "2", "--no-video", "--pipeline.motion.voxel-size", "0.2", IN_TURN]
    assert main(["run", str(street), "--out", str(first), *words]) == 0
    config = first / "config.yaml"
    assert main(["run", "--config", str(config), "--out", str(second)]) == 0
    assert (second / "config.yaml").read_text() == config.read_text()
    assert yaml.safe_load(config.read_text())["pipeline"]["motion"]["voxel_size_m"] == 0.2
    assert (second / "tracks.jsonl").read_text() == (first / "tracks.jsonl").read_text()
    assert not (second / "video.mp4").exists()


def test_results_are_refused_or_replaced(street, tmp_path):
    out = tmp_path / "out"
    words = ["run", str(street), "--out", str(out), "--no-video", IN_TURN]
    assert main([*words, "--frames", "2"]) == 0
    (out / "labels" / "notes.txt").write_text("mine")
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    with fault(UsageError, where=str(out), advice="--overwrite"):
        command(*words, "--frames", "1")
    # What cannot work replaces nothing.
    assert main([*words, "--overwrite", "--pipeline.detection.dm-model", "nowhere.onnx"]) == 2
    assert main([*words, "--overwrite", "--track", "-1"]) == 2
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert main([*words, "--overwrite", "--frames", "1"]) == 0
    assert sorted(path.name for path in (out / "labels").iterdir()) == ["000000.label", "notes.txt"]
    assert len(RunFolder(out).frames()) == len(RunFolder(out).tracks()) == 1


def test_what_was_written_is_read_back(results, street):
    folder, drive = RunFolder(results), open_drive(street)
    frames = folder.frames()
    assert [frame.frame for frame in frames] == list(range(FRAMES))
    assert [len(line.tracks) for line in folder.tracks().values()] == [
        frame.tracks for frame in frames
    ]
    assert [len(line.vehicles) for line in folder.vehicles().values()] == [
        one.vehicles for one in frames
    ]
    poses = folder.poses()
    np.testing.assert_allclose(poses[:, :3, 3], [one.position_m for one in frames], atol=1e-4)
    assert folder.summary()["frames"] == FRAMES
    for frame in frames:
        labels, obstacles = folder.labels(frame.name), folder.obstacles(frame.name)
        assert len(labels) == len(drive[frame.frame].points_velo)
        assert len(obstacles["static_centers_m"]) == frame.voxels["static"]
        assert len(obstacles["ground_xy_m"]) == len(obstacles["ground_height_m"])


def test_a_folder_without_a_run_is_named(tmp_path):
    with pytest.raises(DriveError) as caught:
        RunFolder(tmp_path)
    assert (caught.value.where, caught.value.found) == (str(tmp_path), "no frames.jsonl")


def test_a_damaged_scan_stops_the_run_and_keeps_what_was_done(damaged, tmp_path):
    out = tmp_path / "out"
    with fault(ScanError, where="0000000002.bin", found="1001 bytes"):
        command("run", damaged, "--out", out, IN_TURN)
    assert len((out / "frames.jsonl").read_text().splitlines()) == 2
    assert len((out / "tracks.jsonl").read_text().splitlines()) == 2
    assert json.loads((out / "summary.json").read_text())["frames"] == 2
    assert frames_of(out / "video.partial.mp4") == 2


def test_sentences_do_not_run_into_the_progress_bar(damaged, tmp_path):
    # A process of its own, since pytest takes the place of the program's log handler.
    program = "import sys, json; from perception.cli.main import main\n"
    program += "print('codes', [main(words) for words in json.loads(sys.argv[1])])"
    words = ["run", str(damaged), "--no-video", IN_TURN]
    runs = [
        [*words, "--out", str(tmp_path / policy), "--on-bad-frame", policy]
        for policy in ("stop", "skip")
    ]
    ran = subprocess.run(
        [sys.executable, "-c", program, json.dumps(runs)],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ran.stdout.splitlines()[-1] == "codes [2, 0]"
    lines = [line.rpartition("\r")[2] for line in ran.stderr.split("\n")]
    for sentence in ("trifuse run: ", "skipped frame 2: "):
        assert any(line.startswith(sentence) and "0000000002.bin" in line for line in lines)


def test_a_damaged_scan_can_be_skipped(damaged, tmp_path):
    out = tmp_path / "out"
    words = ["run", str(damaged), "--out", str(out), "--video", "false", "--on-bad-frame", "skip"]
    assert main([*words, IN_TURN]) == 0
    frames = [json.loads(line)["frame"] for line in (out / "frames.jsonl").read_text().splitlines()]
    assert frames == [0, 1, 3]


@pytest.mark.parametrize("missing", ["oxts", "image_02"])
def test_a_drive_without_ins_or_camera_runs(street, missing, tmp_path):
    copy = tmp_path / street.parent.name / street.name
    copy.parent.mkdir()
    for path in street.parent.glob("calib_*.txt"):
        (copy.parent / path.name).write_bytes(path.read_bytes())
    copy.mkdir()
    for entry in street.iterdir():
        if entry.name != missing:
            (copy / entry.name).symlink_to(entry)
    out = tmp_path / "out"
    assert main(["run", str(copy), "--out", str(out), "--frames", "2", IN_TURN]) == 0
    assert frames_of(out / "video.mp4") == 2


def test_the_thesis_method_runs(street, tmp_path):
    words = [
        "run",
        str(street),
        "--out",
        str(tmp_path),
        "--video",
        "false",
        "--frames",
        "2",
        IN_TURN,
    ]
    assert main([*words, "--pipeline.method", "thesis"]) == 0


def test_a_folder_or_command_that_does_not_exist_is_an_error():
    with fault(DriveError, where="nowhere", found="no such folder"):
        command("run", "nowhere")
    with fault(UsageError, where="command line", found="fly"):
        command("fly")


def test_demo_leaves_a_video_and_says_whether_the_machine_keeps_up(tmp_path, capsys):
    words = ["demo", "--out", str(tmp_path / "demo"), "--frames", "3"]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "points against the truth of this drive" in printed
    starts = [line.partition(":")[0] for line in printed.splitlines()[-9:]]
    summed_up = [
        "points/frame",
        "tracks",
        "vehicles",
        "health",
        "pipeline",
        "run",
        "results",
        "video",
    ]
    assert starts == ["", *summed_up]
    assert "all stages" not in printed
    assert "all stages" in json.loads((tmp_path / "demo/summary.json").read_text())["stages_ms"]
    assert frames_of(tmp_path / "demo/video.mp4") == 3
