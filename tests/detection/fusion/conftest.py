"""A network so small that its answer is known: each new score is a weighted sum of the three old ones."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

from perception.detection.config import FusionVariant
from perception.detection.fusion.features import FEATURES

AS_IT_WAS = np.eye(3)
Write = Callable[..., Path]


def weighted_sums(variant: FusionVariant, weights, **metadata: str) -> bytes:
    """Return a file of: scores = (the first 3 features, which are the scores) @ weights."""
    names = FEATURES[variant]
    matrix = np.zeros((len(names), 3), np.float32)
    matrix[:3] = weights
    nodes = [helper.make_node("MatMul", ["features", "matrix"], ["scores"])]
    graph = helper.make_graph(
        nodes,
        "weighted_sums",
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, ["T", len(names)])],
        [helper.make_tensor_value_info("scores", TensorProto.FLOAT, ["T", 3])],
        [numpy_helper.from_array(matrix, "matrix")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    known = {
        "kind": "fusion",
        "modalities": "rgb,dm,rm",
        "variant": variant,
        "features": ",".join(names),
        "hidden": "",
        "calibration": "1.0,1.0,0.0",
        "classes": "Car",
    }
    helper.set_model_props(model, known | metadata)
    return bytes(model.SerializeToString())


@pytest.fixture
def fusion_file(tmp_path) -> Write:
    """Return a function that writes such a file: variant, (3, 3) weights, other facts by name."""

    def write(variant: FusionVariant = "features", weights=AS_IT_WAS, **metadata: str) -> Path:
        path = tmp_path / f"fusion_{variant}.onnx"
        path.write_bytes(weighted_sums(variant, weights, **metadata))
        return path

    return write
