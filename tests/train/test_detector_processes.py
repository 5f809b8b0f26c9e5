"""Two processes train one detector together, and measure what both have seen."""

import json

import numpy as np
import pytest
import torch

from perception.detection.detectors.postprocess import postprocess_detections
from tests.train.together import train_together
from tests.train.toy_images import SIZE, ToyImages, tiny_network
from train.checkpoints import read_checkpoint
from train.detector import networks
from train.detector.metrics import ValidationBoxes, measure, precision_table
from train.detector.networks import MODEL, load_detector

SCRIPT = """
import json, sys
from pathlib import Path
import torch
from tests.train.toy_images import SIZE, ToyImages, tiny_network
from train.detector import networks
from train.config import OptimizerConfig, TrainingRun
from train.detector.config import DETECTOR_PRESETS
from train.detector.networks import DetectorNetworkConfig
from train.detector.run import train_detector
from train.detector.training import DetectorTrainingConfig
from train.folder import TrainingFolder
torch.set_num_threads(1)
networks.NETWORKS["tiny"] = tiny_network
network = DetectorNetworkConfig("dm", ("Car",), SIZE, network="tiny")
optimizer = OptimizerConfig(learning_rate=0.02, ema_decay=0.8, gradient_clip_norm=20.0)
config = DetectorTrainingConfig(network, optimizer, DETECTOR_PRESETS["default"].loss)
run = TrainingRun(epochs=2, accelerator="cpu", devices=2)
trained = train_detector(ToyImages(4, repeats=16), config, run, TrainingFolder(Path(sys.argv[1])))
if trained is not None:
    print(json.dumps({"epoch": trained.epoch, **trained.counts}))
"""


def test_two_processes_train_one_detector(tmp_path, monkeypatch):
    printed = train_together(SCRIPT, tmp_path)
    (line,) = printed  # of one process only
    assert json.loads(line)["validation_labels"] == 16
    monkeypatch.setitem(networks.NETWORKS, "tiny", tiny_network)
    detector, _ = load_detector(tmp_path / "out" / "last.ckpt")
    saved = read_checkpoint(tmp_path / "out" / "last.ckpt", MODEL)
    assert saved["global_step"] == 2 * 16 / 2
    # Both saw every picture; a measure that counted them twice would call every second detection wrong.
    samples, boxes = ToyImages(4, repeats=1).training, ValidationBoxes(("Car",))
    for row in range(len(samples)):
        with torch.inference_mode():
            decoded = detector.decode(detector(samples[row]["images"][None]))
        seen = postprocess_detections(*(part[0].numpy() for part in decoded), ("Car",), SIZE)
        boxes.update([seen], torch.tensor([row]), process=0)
    found = boxes.gathered(SIZE, np.array([samples.image_size_px(0)] * len(samples)))
    alone = precision_table(measure(samples.truth(), found, len(samples), ("Car",)))
    for name, of_difficulty in alone.items():
        assert saved["precision"][name] == pytest.approx(of_difficulty, abs=0.01)
    assert alone["Car 0.5"]["moderate"] > 1
