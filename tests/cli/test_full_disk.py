"""Commands on a full disk: one sentence with the name of the file, and nothing half written."""

import json
from pathlib import Path

import pytest

from perception.cli.main import run_command_line
from perception.errors import WriteError
from tests.car_frames import write_car_frames
from tests.faults import fault
from tests.full_disk import file_size_limit


@pytest.fixture(scope="module")
def frames(make_once) -> Path:
    """Return two object frames of 80 kB a scan, without images."""
    return make_once("full_disk_frames", lambda folder: write_car_frames(folder, frames=2))


def fill_disk(words: list[str], room: int, file: Path) -> None:
    """Run a command that finds no room for a file."""
    with file_size_limit(room), fault(WriteError, str(file), found="File too large", advice="room"):
        run_command_line(words)


def files_in(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_a_run_ends_at_the_first_file_without_room(tmp_path):
    drive = write_car_frames(tmp_path / "drive", frames=1)
    scan = drive / "training/velodyne/000000.bin"
    scan.write_bytes(scan.read_bytes() * 4)  # so that its labels need more than the configuration
    out = tmp_path / "out"
    words = ["run", str(drive), "--out", str(out), "--no-video", "--no-report"]
    fill_disk([*words, "--pipeline.no-parallel"], 50_000, out / "labels/000000.label")
    assert files_in(out) == {"config.yaml", "summary.json"}
    assert json.loads((out / "summary.json").read_text())["frames"] == 0


def test_maps_end_at_the_first_file_without_room(frames, tmp_path):
    words = ["maps", str(frames), "--all", "--out", str(tmp_path)]
    fill_disk(words, 2_000, tmp_path / "depth/000000.png")
    assert files_in(tmp_path) == {"config.yaml"}


def test_a_report_without_room_leaves_no_part(frames, tmp_path):
    words = ["evaluate", "ground", str(frames), "--json", str(tmp_path / "ground.json")]
    fill_disk(words, 3_000, tmp_path / "ground.json")
    assert files_in(tmp_path) == set()


@pytest.mark.parametrize("words", [["ground"], ["obstacles"], ["results", "--labels", "nowhere"]])
def test_a_report_that_could_not_be_written_is_named_before_any_work(words, tmp_path):
    (tmp_path / "file").touch()
    for path, found in (
        (tmp_path, "Is a directory"),
        (tmp_path / "file" / "new" / "x.json", "Not a directory"),
    ):
        with fault(WriteError, str(path), found=found):
            run_command_line(["evaluate", words[0], "nowhere", *words[1:], "--json", str(path)])


SYNTH = "synth {out} --layout tracking --frames 3 --sensor VLP-16 --no-images"


@pytest.mark.parametrize(
    ("words", "size"),
    [(SYNTH, "600k"), ("maps {frames} --all --out {out}", "40k")],
    ids=["synth", "maps"],
)
def test_a_small_disk_is_one_sentence_and_what_was_finished_stays(words, size, frames, small_disk):
    small_disk.resize(size)
    out = small_disk.path / "out"
    with fault(WriteError, where=str(out), found="No space left on device", advice="make room"):
        run_command_line(words.format(frames=frames, out=out).split())
    left = files_in(out)
    assert left
    assert not [path for path in left if ".part" in path]
    assert all((out / path).stat().st_size for path in left)


def test_a_recording_without_room_leaves_the_results_so_far(frames, tmp_path):
    words = ["run", str(frames), "--out", str(tmp_path), "--mcap", "--no-video", "--no-report"]
    path = tmp_path / "results.mcap"
    fill_disk([*words, "--pipeline.no-parallel"], 60_000, path)
    assert not [name for name in files_in(tmp_path) if "mcap" in name]
    summary = json.loads((tmp_path / "summary.json").read_text())
    lines = (tmp_path / "frames.jsonl").read_text().splitlines()
    assert [json.loads(line)["frame"] for line in lines] == list(range(summary["frames"]))
