"""A detector's network with the weights that its training starts from."""

from perception.errors import UsageError
from train.checkpoint_writer import require_same_network
from train.detector.config import InitialWeights
from train.detector.darknet_weights import init_from_darknet
from train.detector.networks import (
    IDENTITY,
    MODEL,
    DetectorNetworkConfig,
    load_detector,
    make_detector,
)
from train.detector.public_weights import init_from_public
from train.networks.torchvision_detector import TorchvisionDetector, init_from_classifier
from train.networks.yolo_detector import YoloDetector
from train.networks.yolov2 import YOLOv2
from train.networks.yolox import YoloxNano


def initial_network(config: DetectorNetworkConfig, weights: InitialWeights) -> YoloDetector:
    """Return the network with its initial weights.

    Raises:
        ModelError: weights cannot be read, or are of another network.
        UsageError: the network does not take weights of this kind.
    """
    if weights.checkpoint is not None:
        stated = {"model": MODEL, **config.metadata}
        require_same_network(weights.checkpoint, stated, IDENTITY)
        trained, _ = load_detector(weights.checkpoint)
        return trained.train()
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
    return network
