"""A detector: a backbone from an image to a feature map, and a head that predicts boxes from it."""

from typing import Any

from torch import Tensor, nn

from perception.detection.detectors.input_size import SIZE_STEP_PX
from perception.errors import ModelError
from train.networks.yolo_head import DecodedBoxes, DetectionHead


class YoloDetector(nn.Module):
    """Detector of objects in images of any size that is a multiple of 32.

    Attributes:
        channels: Channels of the image: 3 for RGB, 1 for a depth or reflectance map.
        trunk: Backbone: images (B, C, H, W) of 0..1 to a feature map.
        head: Head: the feature map to boxes.
    """

    def __init__(self, channels: int, trunk: nn.Module, head: DetectionHead[Any]) -> None:
        super().__init__()
        self.channels = channels
        self.trunk = trunk
        self.head = head

    @property
    def class_names(self) -> tuple[str, ...]:
        """Names of the classes in the order of the scores."""
        return self.head.class_names

    def forward(self, images: Tensor) -> Any:  # noqa: ANN401 - as its head makes them
        """Return the head's raw predictions for (B, C, H, W) of 0..255."""
        self._require_image(images)
        dtype = next(self.parameters()).dtype
        return self.head(self.trunk(images.to(dtype) / 255))

    def decode(self, raw: Any) -> DecodedBoxes:  # noqa: ANN401
        """Return the boxes and scores of raw predictions."""
        return self.head.decode(raw)

    def _require_image(self, images: Tensor) -> None:
        height, width = images.shape[-2:]
        is_divisible = height % SIZE_STEP_PX == 0 and width % SIZE_STEP_PX == 0
        if images.ndim != 4 or images.shape[1] != self.channels or not is_divisible:
            raise ModelError(
                type(self).__name__,
                expected=f"images (B, {self.channels}, H, W) with H and W multiples of {SIZE_STEP_PX}",
                found=f"shape {tuple(images.shape)}",
            )
