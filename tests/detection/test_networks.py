"""Which detectors run, by method, sensor, what is asked for, and the files that are named."""

import pytest

from perception.detection.config import DepthCnConfig, DetectionConfig
from perception.detection.networks import chosen_detection, detectors_note
from perception.sensor import HDL_32E, HDL_64E, VLP_16
from perception.types import DETECTOR_MODALITIES, MODALITIES


@pytest.mark.parametrize(
    ("config", "sensor", "method", "modalities", "has_depthcn"),
    [
        (DetectionConfig(), HDL_32E, "default", ("rgb", "bev"), False),
        (DetectionConfig(), HDL_64E, "default", MODALITIES, False),
        (DetectionConfig(), VLP_16, "thesis", MODALITIES, True),
        (DetectionConfig(bev_model="bev.onnx"), HDL_64E, "thesis", DETECTOR_MODALITIES, True),
        (DetectionConfig(method="thesis"), HDL_64E, "default", MODALITIES, True),
        (DetectionConfig(dm_model="d.onnx"), VLP_16, "default", ("rgb", "dm", "bev"), False),
        (DetectionConfig(modalities=("rm",)), HDL_64E, "thesis", ("rm",), True),
        (DetectionConfig(modalities=(), depthcn=DepthCnConfig(enabled=False)), HDL_64E, "thesis", (), False),
        (DetectionConfig(depthcn=DepthCnConfig(model="d.onnx")), VLP_16, "default", ("rgb", "bev"), True),
    ],
)  # fmt: skip
def test_modalities_are_those_asked_for_else_those_of_method_sensor_and_named_files(
    config, sensor, method, modalities, has_depthcn
):
    chosen = chosen_detection(config, sensor, method)
    assert chosen.modalities == modalities
    assert chosen.depthcn.enabled == has_depthcn


def test_a_line_says_which_detectors_run_and_why():
    assert detectors_note(DetectionConfig(), VLP_16) == (
        "detectors: rgb, bev (the default of 16 beams; trifuse study modalities measures others)"
    )
    asked = DetectionConfig(modalities=("dm",), depthcn=DepthCnConfig(enabled=False))
    assert detectors_note(asked, VLP_16) == "detectors: dm (as asked)"
    assert detectors_note(DetectionConfig(), VLP_16, "thesis") == (
        "detectors: rgb, dm, rm, DepthCN (method thesis)"
    )
