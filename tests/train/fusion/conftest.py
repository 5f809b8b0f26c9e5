"""A small fusion of each kind, fitted once to simulated detectors."""

import pytest

from export.fusion import export_fusion
from export.result import ExportConfig
from perception.detection.fusion.rescoring import Fusion
from tests.simulated_detectors import simulated_frames
from train.config import TrainingRun
from train.folder import TrainingFolder
from train.fusion.config import FusionTrainingConfig, LevenbergMarquardtConfig
from train.fusion.targets import FusionSets, fusion_rows
from train.fusion.training import fit_fusion


@pytest.fixture(scope="session")
def fitted(tmp_path_factory):
    """Return the fusion of all features with losses, fitted by 20 steps to 50 frames."""
    out = tmp_path_factory.mktemp("fitted")
    sets = FusionSets(
        fusion_rows(simulated_frames(50, 1), "default"),
        fusion_rows(simulated_frames(25, 2), "default"),
    )
    config = FusionTrainingConfig((8,), "lm", lm=LevenbergMarquardtConfig(max_steps=20))
    found = fit_fusion(sets, config, TrainingRun(), TrainingFolder(out))
    file = out / "fusion.onnx"
    file.write_bytes(export_fusion(ExportConfig(found.checkpoint)).models["fp32"])
    return Fusion(file)
