"""YOLOv2 as published, for any class list (thesis 3.3.1, 6.2.3).

                      Darknet-19
    picture ----> fine, 1/16 ----> coarse, 1/32 ----> 2 x conv 1024 --+
                     |                                                +--> conv 1024 --> head
                     +--> conv 64 --> reorganised to 1/32, 256 -------+

Modules are created in the order of `yolov2.cfg`, which is the order of numbers in a weight file.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from train.networks.darknet19 import (
    COARSE_CHANNELS,
    FINE_CHANNELS,
    ConvolutionUnit,
    Darknet19,
    units,
)
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import YoloHead

STRIDE_PX = 32
_PASSED_CHANNELS = 64

# Published with `yolov2.weights` (COCO) and `yolov2-voc.weights`, there in cells of 32 pixels.
COCO_ANCHORS_CELLS = (
    (0.57273, 0.677385),
    (1.87446, 2.06253),
    (3.33843, 5.47434),
    (7.88282, 3.52778),
    (9.77052, 9.16828),
)
VOC_ANCHORS_CELLS = (
    (1.3221, 1.73145),
    (3.19275, 4.00944),
    (5.05587, 8.09892),
    (9.47112, 4.84053),
    (11.2364, 10.0071),
)


def anchors_px(anchors_cells: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return anchors given in cells, as Darknet's cfg files do, in pixels."""
    return [(width * STRIDE_PX, height * STRIDE_PX) for width, height in anchors_cells]


class Yolov2Trunk(nn.Module):
    """Darknet-19, two more convolutions, and the fine map passed to them."""

    out_channels = 1024

    def __init__(self) -> None:
        super().__init__()
        self.backbone = Darknet19()
        self.deep = nn.Sequential(*units(COARSE_CHANNELS, ((1024, 3), (1024, 3))))
        self.passed = ConvolutionUnit(FINE_CHANNELS, _PASSED_CHANNELS, 1)
        self.joined = ConvolutionUnit(4 * _PASSED_CHANNELS + 1024, self.out_channels, 3)

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, 1024, H / 32, W / 32); a map of one channel goes in three times."""
        fine, coarse = self.backbone(images.expand(-1, 3, -1, -1))
        passed = reorganise(self.passed(fine))
        joined: Tensor = self.joined(torch.cat([passed, self.deep(coarse)], dim=1))
        return joined


class YOLOv2(YoloDetector):
    """The thesis' detector of each modality."""

    def __init__(
        self,
        class_names: Sequence[str] = ("Car",),
        anchors_px: Sequence[tuple[float, float]] = tuple(anchors_px(VOC_ANCHORS_CELLS)),
        channels: int = 3,
    ) -> None:
        """Build it with random weights.

        Args:
            class_names: Classes to detect.
            anchors_px: Widths and heights of the anchors in pixels of the input.
            channels: 3, or 1 for maps.
        """
        trunk = Yolov2Trunk()
        super().__init__(
            channels, trunk, YoloHead(trunk.out_channels, STRIDE_PX, anchors_px, class_names)
        )


def reorganise(maps: Tensor) -> Tensor:
    """Turn (B, C, H, W) into (B, 4C, H / 2, W / 2) in Darknet's own order.

    Darknet reads the C maps of H x W, without moving a number, as C / 4 maps of 2H x 2W; takes the
    four pixels of every 2 x 2 block of these apart, which gives C maps of H x W again; and reads those
    as 4C maps of half the size. Published weights were trained behind this order, and fit no other.
    """
    batch, channels, height, width = maps.shape
    blocks = maps.reshape(batch, channels // 4, height, 2, width, 2)
    apart = blocks.permute(0, 3, 5, 1, 2, 4)
    return apart.reshape(batch, 4 * channels, height // 2, width // 2)
