"""YOLOv2's head behind any classifier of torchvision, for pretrained weights.

classifier   last maps at a stride of 8, 16 and 32
              |           |           |
             1x1         1x1         1x1
              + <-- up -- + <-- up -- +
             3x3 --> head, a cell of 8 pixels
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from urllib.error import URLError

import torch
from torch import Tensor, nn
from torch.fx.proxy import TraceError
from torchvision import models  # type: ignore[import-untyped]
from torchvision.models.feature_extraction import (  # type: ignore[import-untyped]
    create_feature_extractor,
    get_graph_node_names,
)
from torchvision.ops import Conv2dNormActivation  # type: ignore[import-untyped]

from perception.errors import ModelError
from train.checkpoints import load_tensors
from train.networks.compact import KITTI_CAR_ANCHORS_PX
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import YoloHead

STRIDES_PX = (8, 16, 32)
_WIDTH = 128  # channels where the three maps are added up
_FIRST_SCORE = 0.02
_PROBE_PX = 64
# Statistics of ImageNet, by which torchvision's classifiers normalize images of 0..1.
_MEAN, _DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


class TorchvisionTrunk(nn.Module):
    """A classifier's maps of three strides, added up at the finest."""

    out_channels = _WIDTH

    def __init__(self, name: str) -> None:
        super().__init__()
        classifier = models.get_model(name, weights=None)
        nodes = _nodes_by_stride(name, classifier)
        self.maps = create_feature_extractor(classifier, {node: node for node in nodes})
        with torch.no_grad():
            found = self.maps.eval()(torch.zeros(1, 3, _PROBE_PX, _PROBE_PX)).values()
        self.maps.train()
        self.sides = nn.ModuleList(
            Conv2dNormActivation(maps.shape[1], _WIDTH, 1, activation_layer=None) for maps in found
        )
        self.lift = nn.Upsample(scale_factor=2, mode="nearest")
        self.join = Conv2dNormActivation(_WIDTH, _WIDTH)
        self.register_buffer("mean", torch.tensor(_MEAN)[:, None, None], persistent=False)
        self.register_buffer("deviation", torch.tensor(_DEVIATION)[:, None, None], persistent=False)

    mean: Tensor
    deviation: Tensor

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, 128, H / 8, W / 8); a map of one channel goes in three times."""
        normal = (images.expand(-1, 3, -1, -1) - self.mean) / self.deviation
        eighth, sixteenth, coarse = (
            side(maps) for side, maps in zip(self.sides, self.maps(normal).values(), strict=True)
        )
        joined: Tensor = self.join(eighth + self.lift(sixteenth + self.lift(coarse)))
        return joined


class TorchvisionDetector(YoloDetector):
    """A detector with a backbone that may be pretrained on ImageNet."""

    def __init__(
        self,
        name: str,
        class_names: Sequence[str] = ("Car",),
        anchors_px: Sequence[tuple[float, float]] = KITTI_CAR_ANCHORS_PX,
        channels: int = 3,
    ) -> None:
        """Build it with random weights.

        Args:
            name: Name of the classifier in torchvision.
            class_names: Classes to detect.
            anchors_px: Widths and heights of the anchors in pixels of the input.
            channels: 3, or 1 for maps.

        Raises:
            ModelError: the classifier has no maps at these strides.
        """
        trunk = TorchvisionTrunk(name)
        head = YoloHead(_WIDTH, STRIDES_PX[0], anchors_px, class_names, _FIRST_SCORE)
        super().__init__(channels, trunk, head)


@cache
def trunk_names() -> tuple[str, ...]:
    """Name the classifiers of torchvision."""
    return tuple(models.list_models(module=models))


def init_from_classifier(detector: TorchvisionDetector, name: str, weights: str) -> None:
    """Fill the trunk from a classifier that was trained before.

    Args:
        detector: Detector with that classifier as its backbone.
        name: Name of the classifier in torchvision.
        weights: File of its state_dict as torchvision publishes it, or the word download.

    Raises:
        ModelError: it cannot be fetched or read, or is of another classifier.
    """
    state = _fetch(name) if weights == "download" else _read(Path(weights))
    # The maps need no classes: what was behind them is left out.
    maps = detector.trunk.get_submodule("maps")
    required = maps.state_dict()
    try:
        maps.load_state_dict({key: state[key] for key in required if key in state})
    except RuntimeError as error:
        fits = sum(key in state and state[key].shape == required[key].shape for key in required)
        raise ModelError(
            weights,
            expected=f"the {len(required)} weights of {name} that its maps need",
            found=f"{fits} of them",
        ) from error


def _read(path: Path) -> dict[str, Tensor]:
    expected = "a state_dict as torchvision publishes it"
    state = load_tensors(path, expected)
    if not isinstance(state, dict):
        raise ModelError(path, expected=expected, found=type(state).__name__)
    return dict(state)


def _fetch(name: str) -> dict[str, Tensor]:
    try:
        state = models.get_model_weights(name)["DEFAULT"].get_state_dict(progress=False)
    except (URLError, OSError) as error:
        raise ModelError(
            name,
            expected="its weights from torchvision's server",
            found=str(error),
            advice="fetch the file elsewhere and give its path",
        ) from error
    return dict(state)


def _nodes_by_stride(name: str, classifier: nn.Module) -> list[str]:
    """Return the last steps of a classifier whose maps have each of the strides."""
    try:
        _, nodes = get_graph_node_names(classifier)
        every = create_feature_extractor(classifier, {node: node for node in nodes}).eval()
        with torch.no_grad():
            found = every(torch.zeros(1, 3, _PROBE_PX, _PROBE_PX))
    except (AssertionError, RuntimeError, TraceError) as error:
        expected = "a classifier that takes images of any size"
        raise ModelError(name, expected=expected, found=str(error)) from error
    last = {
        int(_PROBE_PX / maps.shape[2]): node
        for node, maps in found.items()
        if isinstance(maps, Tensor) and maps.ndim == 4 and maps.shape[2] == maps.shape[3]
    }
    if not set(STRIDES_PX) <= set(last):
        raise ModelError(
            name, expected=f"maps with strides of {STRIDES_PX}", found=f"{sorted(last)}"
        )
    return [last[stride] for stride in STRIDES_PX]
