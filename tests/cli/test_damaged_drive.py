"""Every command takes a drive whose scans are damaged in every way."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from data.kitti.calibration import DriveCalibration, format_benchmark_calibration
from data.kitti.labels import format_tracking_labels
from data.kitti.oxts import Mercator, format_oxts_packet
from perception.cli.main import main
from perception.types import Labels
from tests.damaged_scans import CALIBRATION, CAR, DAMAGES, REFUSED, road_scan

COMMANDS = {
    "run": "run DRIVE --out OUT --no-video",
    "detect": "detect DRIVE --out OUT --no-video",
    "track": "track DRIVE --out OUT --no-video --track-id 7",
    "maps": "maps DRIVE --out OUT --all",
    "ground": "evaluate ground DRIVE",
    "obstacles": "evaluate obstacles DRIVE",
    "datmo": "evaluate datmo DRIVE",
    "detection": "evaluate detection DRIVE",
}


@pytest.fixture(scope="module")
def damaged_drive(tmp_path_factory) -> Path:
    """Return a tracking folder; each scan is damaged otherwise, with a clean one after it."""
    training = tmp_path_factory.mktemp("damaged") / "training"
    labels = Labels(
        boxes_velo=CAR,
        boxes_px=np.array([[30.0, 12, 55, 30]]),
        types=np.array(["Car"]),
        track_ids=np.array([7]),
        truncation=np.zeros(1),
        occlusion=np.zeros(1, np.int64),
        dont_care_px=np.zeros((0, 4)),
    )
    for folder in ("velodyne/0000", "image_02/0000", "calib", "oxts", "label_02"):
        (training / folder).mkdir(parents=True)
    damages = [name for damage in DAMAGES for name in ("none", damage)]
    for number, damage in enumerate(damages):
        with np.errstate(invalid="ignore"):
            DAMAGES[damage](road_scan()).tofile(training / f"velodyne/0000/{number:06d}.bin")
        image = np.full((38, 124, 3), 90, np.uint8)
        cv2.imwrite(str(training / f"image_02/0000/{number:06d}.png"), image)
    rows = [format_tracking_labels(n, labels, CALIBRATION) for n in range(len(damages))]
    (training / "label_02/0000.txt").write_text("".join(rows))
    calibration = format_benchmark_calibration(DriveCalibration(CALIBRATION, np.eye(4)))
    (training / "calib/0000.txt").write_text(calibration)
    world, still = Mercator(49.0, 8.4, 110.0), np.zeros(3)
    packet = format_oxts_packet(world.packet(np.eye(4), still, np.array([0, 0, 9.81]), still))
    (training / "oxts/0000.txt").write_text(f"{packet}\n" * len(damages))
    return training.parent


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_skip_what_is_refused(damaged_drive, tmp_path, command, caplog):
    place = {"DRIVE": str(damaged_drive), "OUT": str(tmp_path)}
    words = [place.get(word, word) for word in COMMANDS[command].split()]
    assert main([*words, "--sensor", "VLP-16", "--on-bad-frame", "skip"]) == 0
    said = [record.getMessage() for record in caplog.records]
    assert sum(sentence.startswith("skipped frame") for sentence in said) == len(REFUSED)
    assert sum("NaN, infinite or beyond 10 km" in sentence for sentence in said) == 1


def test_check_counts_what_is_refused(damaged_drive, capsys):
    assert main(["check", str(damaged_drive), "--sensor", "VLP-16"]) == 2
    lines = capsys.readouterr().out.splitlines()
    (row,) = [line.split() for line in lines if "scans missing or damaged" in line]
    assert int(row[5]) == len(REFUSED)


def test_a_map_without_a_return_is_drawn(damaged_drive, tmp_path):
    number = 2 * list(DAMAGES).index("behind") + 1
    words = ["maps", str(damaged_drive), "--frame", str(number), "--out", str(tmp_path)]
    assert main(words) == 0
    depth = cv2.imread(str(tmp_path / f"depth/{number:06d}.png"), cv2.IMREAD_UNCHANGED)
    assert not depth.any()
