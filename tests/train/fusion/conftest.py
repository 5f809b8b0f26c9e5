"""A small fusion, fitted once to simulated detectors."""

from functools import cached_property

import pytest

from data.detections.split_detections import SplitDetections
from export.fusion import export_fusion
from export.result import ExportConfig
from perception.detection.fusion.rescoring import Fusion
from tests.simulated_detectors import simulated_frames
from tests.train.fusion.toy_rows import toy_words, train_toy
from train.fusion.datamodule import FusionDataModule


class SimulatedRows(FusionDataModule):
    training_data = "simulated"

    @cached_property
    def detections(self) -> SplitDetections:
        parts = [simulated_frames(count, seed) for seed, count in ((1, 50), (2, 25), (3, 25))]
        return SplitDetections(*parts, class_names=("Car",), detectors="simulated", provenance={})


@pytest.fixture(scope="session")
def fitted(tmp_path_factory):
    """Return the default fusion, fitted by AdamW to 50 frames."""
    out = tmp_path_factory.mktemp("fitted")
    words = toy_words("AdamW", 20, "--model.variant=default", "--data.batch_size=100")
    train_toy(out, words, data=SimulatedRows)
    file = out / "fusion.onnx"
    file.write_bytes(export_fusion(ExportConfig(out / "best.ckpt")).models["fp32"])
    return Fusion(file)
