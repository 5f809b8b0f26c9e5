"""The same model files with OpenVINO in place of ONNX Runtime."""

from pathlib import Path

import numpy as np

from export.variants import Arrays, Network
from perception.errors import optional_package


def openvino_network(
    file: Path, threads: int, image_shape: tuple[int, ...] | None = None
) -> Network:
    """Open a detector's file for one image at a time.

    Args:
        file: ONNX file.
        threads: Number of threads of the network.
        image_shape: (C, H, W) of the images; None for those that the file states.

    Raises:
        MissingDependencyError: OpenVINO is not installed.
    """
    with optional_package("openvino", needed_for="the OpenVINO peer", extra="bench"):
        import openvino
    core = openvino.Core()
    model = core.read_model(file)
    shape = image_shape or model.input("images").partial_shape.get_max_shape()[1:]
    model.reshape([1, *shape])
    settings = {
        "INFERENCE_NUM_THREADS": threads,
        "NUM_STREAMS": 1,
        "ENABLE_CPU_PINNING": False,  # several networks share the cores
        "INFERENCE_PRECISION_HINT": "f32",  # else what is not 8-bit may become bfloat16
    }
    request = core.compile_model(model, "CPU", settings).create_infer_request()

    def run(inputs: Arrays) -> Arrays:
        found = request.infer(dict(inputs))
        return {name: np.asarray(found[name]) for name in ("boxes_px", "scores")}

    return run
