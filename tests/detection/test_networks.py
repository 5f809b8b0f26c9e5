"""Which detectors run, by method, by what is asked for, and by the files that are named."""

import pytest

from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.detection.networks import chosen_detection, detectors_note, enabled_modalities
from perception.types import DETECTOR_MODALITIES, MODALITIES


@pytest.mark.parametrize(
    ("config", "method", "modalities", "has_depthcn"),
    [
        (DetectionConfig(bev_model="bev.onnx"), "default", ("rgb", "bev"), False),
        (DetectionConfig(bev_model="bev.onnx"), "thesis", DETECTOR_MODALITIES, True),
        (DetectionConfig(), "thesis", MODALITIES, True),
        (DetectionConfig(method="thesis"), "default", MODALITIES, True),
        (DetectionConfig(bev_model="b.onnx", dm_model="d.onnx"), "default", ("rgb", "dm", "bev"), False),
        (DetectionConfig(modalities=("rm",)), "thesis", ("rm",), True),
        (DetectionConfig(modalities=(), depthcn=DepthCnConfig(enabled=False)), "thesis", (), False),
        (DetectionConfig(bev_model="b.onnx", depthcn=DepthCnConfig(model="d.onnx")), "default", ("rgb", "bev"), True),
    ],
)  # fmt: skip
def test_modalities_are_those_asked_for_else_those_of_the_method_and_of_named_files(
    config, method, modalities, has_depthcn
):
    chosen = chosen_detection(config, method)
    assert chosen.modalities == modalities == enabled_modalities(config, method)
    assert chosen.depthcn.enabled == has_depthcn


def test_a_line_says_which_detectors_run_and_why():
    above = DetectionConfig(bev_model="bev.onnx")
    assert detectors_note(above).startswith("detectors: rgb, bev (the default")
    asked = DetectionConfig(modalities=("dm",), depthcn=DepthCnConfig(enabled=False))
    assert detectors_note(asked) == "detectors: dm (as asked)"
    assert detectors_note(DetectionConfig(), "thesis") == (
        "detectors: rgb, dm, rm, DepthCN (method thesis)"
    )
