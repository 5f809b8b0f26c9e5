"""A new YOLOv2 that starts with what another has learned."""

from contextlib import suppress
from pathlib import Path

from perception.errors import ModelError
from train.detector.darknet_weights import load_darknet_weights
from train.networks.yolov2 import YOLOv2


def init_from_darknet(detector: YOLOv2, path: Path) -> str:
    """Fill as much of a detector as a weight file holds, and name it.

    Args:
        detector: with random weights.
        path: a whole detector of as many classes and anchors; a detector of others, whose head is left
            out; or a backbone such as `darknet19_448.conv.23`.

    Raises:
        ModelError: it is none of these.
    """
    with suppress(ModelError):
        load_darknet_weights(detector, path)
        return "detector"
    with suppress(ModelError):
        load_darknet_weights(detector.trunk, path, is_prefix=True)
        return "trunk"
    backbone = detector.trunk.get_submodule("backbone")
    load_darknet_weights(backbone, path, is_prefix=True)
    return "backbone"
