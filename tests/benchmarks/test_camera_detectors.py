"""The camera view beside public networks: a table of what is there, a note of what is not."""

import logging

import cv2
import numpy as np

from benchmarks.camera_detectors import compare_camera_detectors
from benchmarks.stages import PreparedDrive
from data.open_drive import open_drive
from perception.pipeline import PipelineConfig
from tests.car_frames import SIZE_PX, write_car_frames
from tests.detection.public_forms import write_constant_network


def test_networks_that_are_there_are_measured_on_the_same_frames(tmp_path, monkeypatch, caplog):
    root = write_car_frames(tmp_path / "object", frames=1)
    (root / "training" / "image_2").mkdir()
    cv2.imwrite(str(root / "training" / "image_2" / "000000.png"), np.zeros((*SIZE_PX[::-1], 3)))
    drive = open_drive(root, images=True)
    labels_px = np.float32(drive.labels(0).boxes_px)
    cars = {
        "labels": np.full((1, len(labels_px)), 2),
        "boxes": (labels_px / np.float32([*SIZE_PX] * 2))[None],
        "scores": np.full((1, len(labels_px)), 0.9, np.float32),
    }
    write_constant_network(tmp_path / "deimv2_femto.onnx", cars, sizes=True)
    monkeypatch.setenv("PUBLIC_NETWORKS", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        table = compare_camera_detectors(PreparedDrive(drive, [drive[0]], [], PipelineConfig()))
    text = table.text()
    assert "Trifuse, " in text
    assert "DEIMv2-Femto, 64x96" in text
    assert "Car AP 0.7 [%]" in text
    assert "YOLOX-nano" not in text
    assert "yolox_nano.onnx: expected a public network" in caplog.text
