"""Detector configurations name the field that is out of range."""

import subprocess
import sys
from pathlib import Path

import pytest

from perception.detection.config import (
    DepthCnConfig,
    DetectionConfig,
    NmsConfig,
    ProposalConfig,
    TriBoxConfig,
)
from perception.errors import UsageError
from perception.types import MODALITIES


@pytest.mark.parametrize(
    ("config", "fields", "where", "found"),
    [
        (ProposalConfig, {"cell_m": 0.01}, "proposals", "0.01 m, 0.01 m², 0.3 m, 5"),
        (ProposalConfig, {"radius_m": 0}, "proposals", "0.5 m, 0.01 m², 0 m, 5"),
        (ProposalConfig, {"min_points": 0}, "proposals", "0.5 m, 0.01 m², 0.3 m, 0"),
        (ProposalConfig, {"min_variance_m2": -1}, "proposals", "0.5 m, -1 m², 0.3 m, 5"),
        (NmsConfig, {"min_score": -0.1}, "non-maximum suppression", "-0.1 and 0.5"),
        (NmsConfig, {"max_iou": 0.0}, "non-maximum suppression", "0.01 and 0"),
        (NmsConfig, {"max_iou": 1.5}, "non-maximum suppression", "0.01 and 1.5"),
        (TriBoxConfig, {"max_partners": -1}, "tri-boxes", "0 and -1"),
        (TriBoxConfig, {"min_iou": 1.0}, "tri-boxes", "1 and 4"),
        (DetectionConfig, {"modalities": (*MODALITIES, "dm")}, "modalities", "rgb, dm, rm, dm"),
        (DetectionConfig, {"display_score": 1.2}, "display_score", "1.2"),
    ],
)
def test_values_out_of_range(config, fields, where, found):
    with pytest.raises(UsageError) as caught:
        config(**fields)
    assert (caught.value.where, caught.value.found) == (where, found)


def test_a_model_is_a_path_or_its_text():
    config = DetectionConfig(rgb_model="a.onnx", depthcn=DepthCnConfig(model="b.onnx"))
    assert config == DetectionConfig(
        rgb_model=Path("a.onnx"), depthcn=DepthCnConfig(model=Path("b.onnx"))
    )
    assert (config.models["rgb"], config.fusion_model) == (Path("a.onnx"), None)


def test_import_needs_no_heavy_library():
    code = "import sys, perception.detection.config; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"scipy", "cv2", "onnxruntime", "torch"} & set(loaded.stdout.split())
