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

from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import YoloHead

_LEAK = 0.1
_MOMENTUM = 0.01  # Darknet keeps 0.99 of its running statistics at every step

# Output channels and kernel sizes of each stage; a 2x2 maximum halves the map between two stages.
_FINE_STAGES = (
    ((32, 3),),
    ((64, 3),),
    ((128, 3), (64, 1), (128, 3)),
    ((256, 3), (128, 1), (256, 3)),
    ((512, 3), (256, 1), (512, 3), (256, 1), (512, 3)),
)
_COARSE_STAGE = ((1024, 3), (512, 1), (1024, 3), (512, 1), (1024, 3))

FINE_CHANNELS, COARSE_CHANNELS = 512, 1024
STRIDE_PX = 32
_PASSED_CHANNELS = 64
# Published with `yolov2-voc.weights`, there in cells of 32 pixels.
VOC_ANCHORS_CELLS = (
    (1.3221, 1.73145),
    (3.19275, 4.00944),
    (5.05587, 8.09892),
    (9.47112, 4.84053),
    (11.2364, 10.0071),
)


class ConvolutionUnit(nn.Sequential):
    """Convolution, batch norm, leaky ReLU: what a `[convolutional]` of a Darknet cfg stands for."""

    def __init__(self, channels_in: int, channels_out: int, kernel: int) -> None:
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, padding=kernel // 2, bias=False),
            nn.BatchNorm2d(channels_out, momentum=_MOMENTUM),
            nn.LeakyReLU(_LEAK),
        )


class Darknet19(nn.Module):
    """The 18 convolutions before the classifier, in two parts.

    Attributes:
        fine: Image to (B, 512, H / 16, W / 16).
        coarse: Fine map to (B, 1024, H / 32, W / 32).
    """

    def __init__(self, channels: int = 3) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for stage in _FINE_STAGES:
            layers += [nn.MaxPool2d(2)] if layers else []
            layers += units(channels, stage)
            channels = stage[-1][0]
        self.fine = nn.Sequential(*layers)
        self.coarse = nn.Sequential(nn.MaxPool2d(2), *units(channels, _COARSE_STAGE))

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return the fine and the coarse map."""
        fine = self.fine(images)
        return fine, self.coarse(fine)


def units(channels_in: int, stage: tuple[tuple[int, int], ...]) -> list[ConvolutionUnit]:
    """Return convolutions one behind the other.

    Args:
        channels_in: Channels of the input.
        stage: Output channels and kernel size of each.
    """
    inputs = [channels_in, *(channels for channels, _ in stage[:-1])]
    return [
        ConvolutionUnit(before, channels, kernel)
        for before, (channels, kernel) in zip(inputs, stage, strict=True)
    ]


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
