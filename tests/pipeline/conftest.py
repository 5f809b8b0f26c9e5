"""A short street seen by a camera, and networks that say where the pictures are bright."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from data.synthetic.drive import SyntheticDrive
from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.pipeline import PipelineConfig
from perception.types import DETECTOR_MODALITIES, MODALITIES
from tests.detection.bright_cells import bright_cells
from tests.detection.filled_cells import filled_cells

FRAMES = 3


def blotches(frame):
    """Return an image of bright and dark places, another for each frame; a rendered one takes a second."""
    coarse = np.random.default_rng(frame.index).integers(0, 256, (6, 20, 3)).astype(np.uint8)
    return cv2.resize(coarse, frame.calibration.image_size_px, interpolation=cv2.INTER_LINEAR)


@pytest.fixture(scope="session")
def street_frames():
    frames = list(SyntheticDrive(FRAMES, images=False))
    return [replace(frame, image=blotches(frame)) for frame in frames]


@pytest.fixture(scope="session")
def all_stages(tmp_path_factory) -> PipelineConfig:
    """Return the choice of all stages, with the brightness of cells in place of trained detectors."""
    folder = tmp_path_factory.mktemp("networks")
    files = {}
    for modality in MODALITIES:
        files[f"{modality}_model"] = folder / f"{modality}.onnx"
        files[f"{modality}_model"].write_bytes(bright_cells(modality))
    files["bev_model"] = folder / "bev.onnx"
    files["bev_model"].write_bytes(filled_cells())
    depthcn = DepthCnConfig(enabled=True)
    detection = DetectionConfig(modalities=DETECTOR_MODALITIES, depthcn=depthcn, **files)
    return PipelineConfig(detection=detection)


@pytest.fixture(scope="session")
def stages_in_turn(all_stages) -> PipelineConfig:
    """Return the configuration of all stages one after another, in one thread."""
    return replace(all_stages, parallel=False)
