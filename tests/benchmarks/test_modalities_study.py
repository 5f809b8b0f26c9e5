"""Sets of modalities on a drive without a camera, by a detector whose answer is known."""

import json

import numpy as np
import pytest

from benchmarks.studies.modalities import SetMetrics, Timed
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.sensor import VLP_16
from tests.detection.filled_cells import filled_cells


def test_precision_is_set_beside_the_time_that_it_takes():
    metrics = SetMetrics(car=0.5, pedestrian=0.3, cost_ms=20.0)
    assert metrics.mean_ap == pytest.approx(0.4)
    assert metrics.per_ms == pytest.approx(2.0)


def test_the_first_frame_is_not_timed():
    timed = Timed(range(4))
    assert list(timed) == [0, 1, 2, 3]
    assert len(timed.seconds) == 3


def test_each_set_has_a_row(tmp_path, capsys):
    [folder] = write_drives(
        tmp_path / "drive",
        SynthConfig(layout="tracking", frames=3, sensor=VLP_16, seed=4, images=False, street="jam"),
    )
    model, out = tmp_path / "bev.onnx", tmp_path / "modalities.png"
    model.write_bytes(filled_cells())
    words = ["study", "modalities", str(folder), "--sets", "bev", "--out", str(out)]
    assert main([*words, "--detection.bev-model", str(model)]) == 0
    (rows,) = json.loads(out.with_suffix(".json").read_text())["results"].values()
    assert set(rows) == {"bev"}
    assert 0 <= rows["bev"]["car"] <= 1
    assert np.isfinite(rows["bev"]["per_ms"])
    assert out.is_file()
    assert "VLP-16" in capsys.readouterr().out
