"""A detector's network with the weights that its training starts from."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from perception.errors import ModelError, UsageError
from train.checkpoint_writer import require_same
from train.detector.config import InitialWeights
from train.detector.darknet_weights import init_from_darknet
from train.detector.networks import (
    IDENTITY,
    MODEL,
    DetectorNetworkConfig,
    load_detector,
    make_detector,
)
from train.networks.torchvision_detector import TorchvisionDetector, init_from_classifier
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2
from train.networks.yolox import YoloxNano

SHA256 = "695e750a5d5754bb5a8d5325643b59282191a7e7a564e435a415fd3c578eab14"
ADDRESS = "https://github.com/Kazuhito00/YOLOX-ONNX-TFLite-Sample/raw/3d4f111/model/yolox_nano.onnx"
COCO_CLASSES = 80
# Numbers of COCO's classes that a class of KITTI starts from; their mean logit.
_PERSON, _BICYCLE, _CAR, _MOTORCYCLE, _BUS, _TRUCK = 0, 1, 2, 3, 5, 7
COCO_STARTS: Mapping[str, tuple[int, ...]] = {
    "car": (_CAR,),
    "van": (_CAR, _TRUCK),
    "truck": (_TRUCK, _BUS),
    "pedestrian": (_PERSON,),
    "cyclist": (_BICYCLE, _MOTORCYCLE, _PERSON),
}


def init_from_public(detector: YoloxNano, path: Path) -> None:
    """Initialize a detector of images from the public file; each class from those of COCO that are like it.

    Args:
        detector: Detector of camera images with random weights; a class unlike any of COCO's keeps them.
        path: Public ONNX file.

    Raises:
        ModelError: the file is missing, or another one.
    """
    public = public_detector(path)
    state, mixed = public.state_dict(), dict[str, Tensor]()
    for name, weight in detector.state_dict().items():
        is_of_classes = name.startswith("head.levels") and ".classes." in name
        mixed[name] = (
            _of_classes(state[name], weight, detector.class_names) if is_of_classes else state[name]
        )
    detector.load_state_dict(mixed)


def public_detector(path: Path) -> YoloxNano:
    """Return the public network itself, with COCO's 80 classes by number.

    Raises:
        ModelError: the file is missing, or another one.
    """
    detector = YoloxNano([str(number) for number in range(COCO_CLASSES)])
    layers = [layer for layer in detector.modules() if isinstance(layer, nn.Conv2d)]
    pairs = list(_convolutions(_read(path)))
    (blocks, bias), others = pairs[0], pairs[1:]
    with torch.no_grad():
        for layer, (weight, shift) in zip(
            layers, [(_of_pixels(blocks), bias), *others], strict=True
        ):
            layer.weight.copy_(weight)
            if layer.bias is not None:
                layer.bias.copy_(shift)
    return detector.eval()


def _read(path: Path) -> onnx.ModelProto:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(
            path,
            expected="the public weights of YOLOX-nano",
            found=error.strerror or str(error),
            advice=f"fetch {ADDRESS}",
        ) from error
    found = hashlib.sha256(content).hexdigest()
    if found != SHA256:
        raise ModelError(
            path,
            expected=f"the public weights of YOLOX-nano, SHA-256 {SHA256}",
            found=found,
            advice=f"fetch {ADDRESS}",
        )
    return onnx.load_model_from_string(content)


def _convolutions(model: onnx.ModelProto) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield weight and bias of every convolution in the order of execution."""
    arrays = {entry.name: numpy_helper.to_array(entry) for entry in model.graph.initializer}
    for node in model.graph.node:
        if node.op_type == "Conv":
            weight, bias = (torch.from_numpy(arrays[name].copy()) for name in node.input[1:3])
            yield weight, bias


def _of_pixels(blocks: Tensor) -> Tensor:
    """Turn the first convolution, (out, 12, 3, 3) over 2x2 blocks of BGR 0..255, to (out, 3, 6, 6) over RGB 0..1.

    The 12 channels are 4 places in a block, down first, then to the right, each of 3 colours.
    """
    out = len(blocks)
    right_down_colour = blocks.reshape(out, 2, 2, 3, 3, 3)
    pixels = right_down_colour.permute(0, 3, 4, 2, 5, 1).reshape(out, 3, 6, 6)
    return pixels.flip(1) * 255


def _of_classes(public: Tensor, fresh: Tensor, class_names: Sequence[str]) -> Tensor:
    """Return weights or biases (classes, ...) of our classes from those of COCO's 80."""
    rows = [
        public[list(COCO_STARTS[name.lower()])].mean(dim=0) if name.lower() in COCO_STARTS else own
        for name, own in zip(class_names, fresh, strict=True)
    ]
    return torch.stack(rows)


def initial_network(
    config: DetectorNetworkConfig, weights: InitialWeights
) -> tuple[YoloDetector, Mapping[str, str]]:
    """Return the network with its initial weights, and what the file of a trained network states.

    Raises:
        ModelError: weights cannot be read, or are of another network.
        UsageError: the network does not take weights of this kind.
    """
    if weights.checkpoint is not None:
        trained, stated = load_detector(weights.checkpoint)
        required = {"model": MODEL, **config.metadata}
        require_same(weights.checkpoint, required, stated, IDENTITY)
        return trained.train(), stated
    network, name = make_detector(config), config.network
    if weights.darknet is not None:
        if not isinstance(network, YOLOv2):
            raise UsageError("--model.weights.darknet", expected="network yolov2", found=name)
        init_from_darknet(network, weights.darknet)
    if weights.public is not None:
        if not isinstance(network, YoloxNano) or network.channels != 3:
            found = f"{name} of modality {config.modality}"
            where = "--model.weights.public"
            raise UsageError(where, expected="network yolox-nano of modality rgb", found=found)
        init_from_public(network, weights.public)
    if weights.backbone is not None:
        if not isinstance(network, TorchvisionDetector):
            where = "--model.weights.backbone"
            raise UsageError(where, expected="a classifier of torchvision", found=name)
        init_from_classifier(network, name, weights.backbone)
    return network, {}
