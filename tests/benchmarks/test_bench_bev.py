"""The benchmark of the detector from above: scans to boxes and training samples, beside a network that may be absent."""

import logging

from benchmarks.bev import compare_bev
from benchmarks.stages import PreparedDrive
from data.open_drive import open_drive
from data.synthetic.collection import SynthConfig, write_drives
from perception.pipeline import PipelineConfig
from perception.sensor import VLP_16


def test_scans_and_training_samples_are_timed(tmp_path, monkeypatch, caplog):
    config = SynthConfig(layout="object", frames=2, sensor=VLP_16, images=False)
    [folder] = write_drives(tmp_path, config)
    drive = open_drive(folder)
    monkeypatch.setenv("PUBLIC_NETWORKS", str(tmp_path))
    with caplog.at_level(logging.WARNING):
        table = compare_bev(PreparedDrive(drive, [drive[0], drive[1]], [], PipelineConfig()))
    assert list(table.rows) == ["Trifuse, scan to boxes", "training sample, augmented"]
    assert all(min(row.cpu_seconds) > 0 for row in table.rows.values())
    assert "yolox_nano.onnx: expected a public network" in caplog.text
