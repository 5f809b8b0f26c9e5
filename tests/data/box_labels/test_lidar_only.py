"""A drive of a LiDAR alone, labelled by a tool, is adopted, trains the bird's-eye view and measures it."""

import json
import logging

import pytest

from perception.cli.main import main
from tests.data.box_labels import writers

# By the name that `adopt` prints.
FORMS = {
    "labelCloud": writers.labelcloud, "SUSTechPOINTS": writers.sustechpoints, "KITTI": writers.kitti_lidar,
    "OpenLABEL": writers.openlabel, "Datumaro": writers.datumaro, "Supervisely": writers.supervisely,
    "tracklets": writers.tracklets, "nuScenes": writers.nuscenes_tables,
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_a_lidar_only_drive_is_adopted_trained_and_evaluated(
    form, drive_folder, tmp_path, capsys, caplog
):
    root, out = drive_folder(frames=10), tmp_path / "out"
    FORMS[form](root, 10)
    (root / "drive.yaml").unlink()
    assert main(["adopt", str(root), "--sensor", "HDL-32E", "--height", "2"]) == 0
    assert form in capsys.readouterr().out
    flags = (
        "--model.reach-m 25.6 --model.cell-m 0.4 --trainer.accelerator cpu --data.cache-workers 1"
    )
    with caplog.at_level(logging.WARNING):
        words = f"train bev {root} --steps 1 --workers 0 --out {out} {flags}"
        assert main([*words.split(), "--data.cache", f"{tmp_path}/cache"]) == 0
    assert "no Van, no Bus, no Trailer, no Motorcycle, no Bicycle, which will not" in caplog.text
    classes = json.loads((out / "metrics.json").read_text())["precision"]
    assert (classes["Car"]["labels"], classes["Van"]["labels"]) == (2, 0)
    capsys.readouterr()
    words = f"evaluate detection {root} --protocol nuscenes --detection.modalities bev --frames 3"
    assert main(words.split()) == 0
    rows = dict(row.split()[:2] for row in capsys.readouterr().out.splitlines() if " " in row)
    assert [rows[name] for name in ("car", "truck", "pedestrian", "bus")] == ["3", "3", "3", "0"]
