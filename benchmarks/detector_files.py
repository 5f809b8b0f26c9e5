"""Detectors with random weights, as model files: they are as fast as trained ones."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from export.detector import QUANTIZATION, DecodedDetector
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import PixelRectangle, place, prepare_image
from perception.types import Modality, UInt8
from train.detector.networks import DetectorNetworkConfig, make_detector
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import OBJECTNESS, YoloHead

Precision = Literal["fp32", "int8"]
ModelFiles = Mapping[Precision, Path]
_SHOWN = 8
# Number of boxes at the score threshold, as after training on a busy road.
_LIKELY = 100


def write_detector(
    folder: Path, network: str, modality: Modality, size: InputSize, images: Sequence[UInt8]
) -> ModelFiles:
    """Write a network with random weights in full precision and in 8 bits.

    Args:
        folder: Folder of the files.
        network: Name of the network: compact or yolov2.
        modality: Modality of its input.
        size: Size of its input.
        images: (H, W, C) images of this modality.
    """
    variant = DetectorNetworkConfig(modality, size=size, network=network)
    prepared = [
        prepare_image(one, modality, place(PixelRectangle.whole(one), size))
        for one in images[:_SHOWN]
    ]
    inputs = [one.transpose(2, 0, 1)[None] for one in prepared]
    torch.manual_seed(0)
    detector = make_detector(variant)
    _limit_confident_boxes(detector, torch.from_numpy(np.concatenate(inputs)))
    exportable = Exportable(
        DecodedDetector(detector.eval()).eval(),
        {"images": torch.from_numpy(np.concatenate(inputs[:1] * 2))},
        outputs=("boxes_px", "scores"),
        metadata=variant.metadata,
    )
    model = to_onnx(exportable)
    batches = [{"images": np.ascontiguousarray(one)} for one in inputs]
    contents: dict[Precision, bytes] = {
        "fp32": model,
        "int8": to_int8(model, batches, QUANTIZATION),
    }
    files = {name: folder / f"{network}_{modality}_{name}.onnx" for name in contents}
    for name, file in files.items():
        file.write_bytes(contents[name])
    return files


def _limit_confident_boxes(detector: YoloDetector, images: torch.Tensor) -> None:
    """Calibrate the batch norms, and bias the objectness so that few boxes are likely."""
    with torch.no_grad():
        for _ in range(3):
            detector.train()(images)
        logits = detector.eval()(images[:1])[:, :, OBJECTNESS].flatten()
        threshold = logits.sort(descending=True).values[min(_LIKELY, len(logits)) - 1]
        head = detector.head
        assert isinstance(head, YoloHead)  # of the networks that are compared
        bias = head.convolution.bias
        assert bias is not None  # every head has one
        of_anchors = bias.view(len(head.anchors_px), -1)
        of_anchors[:, OBJECTNESS] += float(np.log(0.01 / 0.99)) - threshold
