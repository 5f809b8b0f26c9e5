"""A small fusion, fitted once to simulated detectors."""

from functools import cached_property

import pytest

from data.detections.split_detections import SplitDetections
from export.fusion import export_fusion
from export.result import ExportConfig
from perception.detection.fusion.rescoring import Fusion
from tests.simulated_detectors import simulated_frames
from tests.train.fusion.toy_rows import train_toy
from train.fusion.datamodule import FusionDataModule


class SimulatedRows(FusionDataModule):
    training_data = "simulated"

    @cached_property
    def detections(self) -> SplitDetections:
        parts = [simulated_frames(count, seed) for seed, count in ((1, 50), (2, 25), (3, 25))]
        return SplitDetections(*parts, class_names=("Car",), detectors="simulated", provenance={})


@pytest.fixture(scope="session")
def fitted(tmp_path_factory):
    """Return the default fusion, fitted to 50 frames."""
    out = tmp_path_factory.mktemp("fitted")
    return train_default(out)


def train_default(out, *more):
    """Return the fusion that the default training makes of the simulated detectors."""
    words = [
        "--data.drives=[simulated]",
        "--data.corrupted_copies=1",
        "--trainer.enable_progress_bar=false",
        *more,
    ]
    train_toy(out, words, data=SimulatedRows)
    file = out / "fusion.onnx"
    file.write_bytes(export_fusion(ExportConfig(out / "best.ckpt")).models["fp32"])
    return Fusion(file)
