"""`trifuse batch` on two workers: the same files as one by one, failures as rows, and nothing done twice."""

import json
from pathlib import Path

import pytest

from perception.cli.main import main, run_command_line
from perception.errors import DriveError, UsageError
from tests.car_frames import write_car_frames
from tests.detection.filled_cells import filled_cells
from tests.faults import fault


@pytest.fixture(scope="module")
def fleet(make_once) -> Path:
    """Return three drives, of which the second has a damaged scan."""

    def write(folder: Path) -> None:
        for name in "abc":
            write_car_frames(folder / name, frames=2)
        next((folder / "b").rglob("000001.bin")).write_bytes(b"cut")

    return make_once("fleet", write)


def states(out: Path) -> dict[str, str]:
    lines = (out / "drives.jsonl").read_text().splitlines()
    return {row["name"]: row["state"] for row in map(json.loads, lines)}


def test_maps_of_a_fleet(fleet, tmp_path, capsys):
    out = tmp_path / "fleet"
    words = ["batch", "maps", f"{fleet}/*", "--out", str(out), "--workers", "2", "--all"]
    assert main(words) == 2
    assert states(out) == {"a": "done", "b": "failed", "c": "done"}
    said = capsys.readouterr()
    assert "drives: 2 done, 0 skipped, 1 failed; 4 frames in" in said.out
    assert "000001.bin" in said.out
    assert "expected 3 drives without an error, found 1 with one, first b" in said.err

    run_command_line(["maps", str(fleet / "a"), "--all", "--out", str(tmp_path / "alone")])
    for path in (tmp_path / "alone").rglob("*.png"):
        of_batch = out / "drives/a" / path.relative_to(tmp_path / "alone")
        assert of_batch.read_bytes() == path.read_bytes()

    words += ["--workers", "1"]  # which leave the same files
    assert main(words) == 2  # what is done is kept, what failed is tried again
    assert states(out) == {"a": "skipped", "b": "failed", "c": "skipped"}
    assert main([*words, "--on-bad-frame", "skip"]) == 0  # another configuration
    assert states(out) == dict.fromkeys("abc", "done")


def test_proposals_of_labels_of_a_fleet(fleet, tmp_path):
    model, out = tmp_path / "bev.onnx", tmp_path / "fleet"
    model.write_bytes(filled_cells())
    words = ["--pipeline.detection.bev-model", str(model), "--pipeline.detection.modalities", "bev"]
    drives = [str(fleet / name) for name in "ac"]
    line = ["batch", "label", *drives, "--out", str(out), "--workers", "1", *words]
    run_command_line(line)
    assert states(out) == {"a": "done", "c": "done"}
    run_command_line(["label", drives[1], "--out", str(tmp_path / "alone"), *words])
    for name in ("proposals.json", "review.html", "boxes/openlabel.json"):
        of_batch = out / "drives/c" / name
        assert of_batch.read_bytes() == (tmp_path / "alone" / name).read_bytes()
    run_command_line(line)
    assert states(out) == {"a": "skipped", "c": "skipped"}
    # Labels are written again by a review, in the place of those of another form.
    review = tmp_path / "review.json"
    review.write_text('{"format": "trifuse review 1", "objects": {}}')
    line = ["label", drives[1], "--out", str(tmp_path / "alone"), "--review", str(review)]
    run_command_line([*line, "--form", "labelcloud"])
    names = sorted(path.name for path in (tmp_path / "alone/boxes").iterdir())
    assert names == ["000000.json", "000001.json"]


def test_a_drive_in_chunks_has_the_same_maps(tmp_path):
    write_car_frames(tmp_path / "a", frames=5)
    out, alone = tmp_path / "fleet", tmp_path / "alone"
    line = ["batch", "maps", str(tmp_path / "a"), "--out", str(out), "--workers", "1", "--all"]
    run_command_line([*line, "--start", "1", "--chunk-frames", "3"])
    assert states(out) == {"a-000001": "done", "a-000004": "done"}
    run_command_line(["maps", str(tmp_path / "a"), "--all", "--start", "1", "--out", str(alone)])
    written = sorted(path.relative_to(alone) for path in alone.rglob("*.png"))
    assert [path.stem for path in written] == [f"{n:06d}" for n in (1, 2, 3, 4)] * 2
    for path in written:
        chunk = "a-000004" if path.stem == "000004" else "a-000001"
        assert (out / "drives" / chunk / path).read_bytes() == (alone / path).read_bytes()


def test_what_follows_objects_is_not_cut_into_chunks(fleet, tmp_path):
    line = [str(fleet), "--out", str(tmp_path / "out"), "--chunk-frames"]
    with fault(UsageError, "--chunk-frames", expected="maps or detect", found="run"):
        run_command_line(["batch", "run", *line, "9"])
    with fault(UsageError, "--chunk-frames", found="0"):
        run_command_line(["batch", "maps", *line, "0"])


def test_drives_at_urls_are_fetched_for_as_long_as_they_are_read(
    fleet, tmp_path, monkeypatch, capsys
):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    out = tmp_path / "fleet"
    sources = [f"file://{fleet}/[ab]", f"file://{fleet}/c"]
    words = ["batch", "maps", *sources, "--out", str(out), "--workers", "1", "--all"]
    assert main(words) == 2
    said = capsys.readouterr()
    assert states(out) == {"a": "done", "b": "failed", "c": "done"}
    assert "4 frames in" in said.out
    assert list(temporary.glob("trifuse-*")) == []
    run_command_line(["maps", str(fleet / "a"), "--all", "--out", str(tmp_path / "alone")])
    written = list((tmp_path / "alone").rglob("*.png"))
    assert len(written) == 4
    for path in written:
        of_batch = out / "drives/a" / path.relative_to(tmp_path / "alone")
        assert of_batch.read_bytes() == path.read_bytes()
    assert main(words) == 2  # what is done is kept, what failed is tried again
    assert states(out) == {"a": "skipped", "b": "failed", "c": "skipped"}


def test_urls_that_lead_nowhere_are_refused_before_any_worker(fleet, tmp_path):
    line = ["batch", "maps", "--out", str(tmp_path / "out")]
    with fault(DriveError, "file:///nowhere/*", expected="a drive", found="no path"):
        run_command_line([*line, "file:///nowhere/*"])
    with fault(UsageError, "odd://x", expected="a path, or a URL", found="odd"):
        run_command_line([*line, "odd://x"])
    with fault(UsageError, "--out", found="a URL of s3:", advice="copy"):
        run_command_line(["batch", "maps", str(fleet), "--out", "s3://bucket/out"])


@pytest.mark.slow
def test_streets_of_a_batch_are_those_of_one_process(tmp_path):
    words = ["--layout", "tracking", "--drives", "2", "--frames", "1", "--no-images"]
    words += ["--sensor", "VLP-16", "--seed", "4"]
    batch, alone = tmp_path / "batch", tmp_path / "alone"
    run_command_line(["batch", "synth", str(batch), *words, "--workers", "2"])
    assert states(batch) == {"part-0001": "done", "part-0002": "done"}
    run_command_line(["synth", str(alone), *words])
    files = [path.relative_to(alone) for path in alone.rglob("training/**/*") if path.is_file()]
    assert len(files) == sum(path.is_file() for path in batch.rglob("training/**/*"))
    for path in files:
        assert (batch / path).read_bytes() == (alone / path).read_bytes(), path


def test_streets_that_cannot_be_made_are_refused_before_any_worker(tmp_path):
    with fault(UsageError, where="HDL-128"):
        run_command_line(["batch", "synth", str(tmp_path / "out"), "--sensor", "HDL-128"])
    assert not (tmp_path / "out").exists()


def test_flags_of_the_command_are_met_before_any_drive(fleet, tmp_path):
    words = ["batch", "maps", str(fleet / "a"), "--out", str(tmp_path / "out"), "--wrong", "1"]
    with fault(UsageError, "command line", found="--wrong"):
        run_command_line(words)
    assert not (tmp_path / "out").exists()


def test_a_batch_of_evaluations_names_its_stage():
    with fault(UsageError, "command line", expected="ground", found="run"):
        run_command_line(["batch", "evaluate", "run"])


def test_the_help_teaches(capsys):
    run_command_line(["batch", "run", "--help"])
    assert "trifuse batch run kitti/raw/2011_09_26/*_sync" in capsys.readouterr().out
