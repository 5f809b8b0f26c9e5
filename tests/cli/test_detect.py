"""`trifuse detect`: the files that it writes, its summary, and its errors."""

import json
import shutil
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from data.kitti.detection_rows import read_detection_set
from perception.cli.main import main
from perception.errors import DriveError, ModelError, ScanError, UsageError
from tests.car_frames import SIZE_PX
from tests.faults import command, fault

FRAMES = 4  # of the street


def detect(drive: Path, out: Path, *words: str) -> int:
    return main(["detect", str(drive), "--out", str(out), *words])


def test_frames_get_result_files_and_previews_by_their_numbers(
    car_frames, label_reader, tmp_path, capsys
):
    label_reader(car_frames)
    out = tmp_path / "out"
    assert detect(car_frames, out) == 0
    assert sorted(path.name for path in (out / "data").iterdir()) == [
        "000000.txt", "000002.txt", "000003.txt",
    ]  # fmt: skip
    previews = sorted((out / "previews").iterdir())
    assert [path.name for path in previews] == ["000000.jpg", "000002.jpg", "000003.jpg"]
    assert cv2.imread(str(previews[0])).shape[1] >= SIZE_PX[0]
    assert not (out / "video.mp4").exists()
    printed = capsys.readouterr().out
    assert "training: 3 frames" in printed
    assert ["reading", "2.0", "2.0", "67"] in map(str.split, printed.splitlines())
    assert "2.0 proposals/frame, 3.0 detections/frame, 2.0 of these with a score of 0.5" in printed


def test_what_is_written_is_read_by_the_measure(car_frames, label_reader, tmp_path):
    label_reader(car_frames)
    out = tmp_path / "out"
    assert detect(car_frames, out, "--no-video") == 0
    found = read_detection_set(out, car_frames)
    assert found.numbers == (0, 2, 3)
    assert found.extra_results == found.missing_results == ()
    assert found.detections.frames.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert found.detections.scores[:3].tolist() == [0.9, 0.8, 0.05]
    assert {len(row.split()) for row in (out / "data/000003.txt").read_text().splitlines()} == {16}
    assert not (out / "previews").exists()


def test_configuration_and_summary_say_what_was_done(car_frames, label_reader, tmp_path):
    label_reader(car_frames)
    out = tmp_path / "out"
    words = ("--depthcn.proposals.radius-m", "0.7", "--display-score", "0.85")
    assert detect(car_frames, out, "--frames", "2", *words) == 0
    config = yaml.safe_load((out / "config.yaml").read_text())
    assert config["depthcn"]["proposals"]["radius_m"] == 0.7
    assert config["nms"]["min_score"] == 0.01
    summary = json.loads((out / "summary.json").read_text())
    assert summary["network"]["training_data"] == "nothing at all"
    assert (summary["frames"], summary["proposals"], summary["detections"]) == (2, 4, 6)
    assert summary["displayed"] == {"display_score": 0.85, "detections": 2}
    assert summary["stages_ms"]["all stages"]["p50"] == 3.0


def test_a_sequence_without_images_becomes_a_video_of_depths(
    tracking_street, label_reader, tmp_path
):
    label_reader(tracking_street, "0000")
    out = tmp_path / "out"
    assert detect(tracking_street, out, "--sequence", "0") == 0
    with av.open(str(out / "video.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == FRAMES
    preview = cv2.imread(str(out / "preview.jpg"))
    # The road before the car is near: red over blue, as nothing else below the middle.
    blue, _, red = preview[330:380, 500:780].mean(axis=(0, 1))
    assert red > blue + 60
    assert len(list((out / "data").iterdir())) == FRAMES


def test_an_interrupted_run_keeps_what_was_done(tracking_street, label_reader, tmp_path, capsys):
    label_reader(tracking_street, "0000", stop_at=2)
    out = tmp_path / "out"
    assert detect(tracking_street, out) == 130
    assert capsys.readouterr().err.count("stopped; what is complete is kept") == 1
    assert sorted(path.name for path in (out / "data").iterdir()) == ["000000.txt", "000001.txt"]
    assert json.loads((out / "summary.json").read_text())["frames"] == 2
    assert (out / "video.partial.mp4").exists()


def test_a_damaged_frame_stops_or_is_skipped(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    scan = car_frames / "training/velodyne/000002.bin"
    scan.write_bytes(scan.read_bytes()[:1001])
    out = tmp_path / "out"
    with fault(ScanError, where="000002.bin", expected="16 bytes a point"):
        command("detect", car_frames, "--out", out)
    assert [path.name for path in (out / "data").iterdir()] == ["000000.txt"]
    assert detect(car_frames, out, "--on-bad-frame", "skip", "--overwrite") == 0
    assert json.loads((out / "summary.json").read_text())["frames"] == 2


def test_a_drive_of_which_no_frame_can_be_read(car_frames, label_reader, tmp_path, capsys):
    label_reader(car_frames)
    for scan in (car_frames / "training/velodyne").iterdir():
        scan.write_bytes(b"")
    assert detect(car_frames, tmp_path / "out", "--on-bad-frame", "skip") == 0
    assert "no frame could be read" in capsys.readouterr().out


def test_without_a_camera_vehicles_have_3d_boxes_all_the_same(tracking_street, tmp_path):
    blind = tmp_path / "blind" / "training"
    shutil.copytree(tracking_street / "training" / "velodyne", blind / "velodyne")
    for drive, name in ((tracking_street, "seen"), (blind.parent, "unseen")):
        assert detect(drive, tmp_path / name, "--sequence", "0", "--no-video") == 0
    seen, unseen = (_located_rows(tmp_path / name) for name in ("seen", "unseen"))
    assert len(unseen) > 0
    # Each vehicle in front is where it is by the camera of the drive, whose axes are nearly the same.
    nearest_m = np.linalg.norm(seen[:, None] - unseen, axis=2).min(axis=1)
    assert np.median(nearest_m) < 0.5


def _located_rows(out: Path) -> np.ndarray:
    """Return (R, 3) x, y and z of the likely vehicles of the first frame that have a 3D box."""
    rows = [row.split() for row in (out / "data" / "000000.txt").read_text().splitlines()]
    numbers = np.array([row[1:] for row in rows], float)
    return numbers[(numbers[:, 14] > 0.5) & (numbers[:, 10] > -1000)][:, 10:13]


@pytest.mark.parametrize(
    ("words", "kind", "expected", "found"),
    [
        (("--sequence", "0007"), DriveError, "sequence 0007", "0000"),
        (("--frames", "0"), UsageError, "at least 1", "0"),
        (("--depthcn.model", "nowhere.onnx"), ModelError, "a model file", "nowhere.onnx"),
    ],
)
def test_no_file_is_written_before_an_error(
    tracking_street, tmp_path, words, kind, expected, found
):
    with fault(kind, expected=expected, found=found):
        command("detect", tracking_street, "--out", tmp_path / "out", *words)
    assert not (tmp_path / "out").exists()


def test_a_file_without_a_network_is_an_error(tracking_street, tmp_path):
    model = tmp_path / "broken.onnx"
    model.write_bytes(b"\x08\x07 not a network")
    with fault(ModelError, where="broken.onnx", expected="a complete ONNX model"):
        command("detect", tracking_street, "--out", tmp_path / "out", "--depthcn.model", model)
