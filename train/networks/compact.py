"""The detector of maps that ships: YOLOv2's head behind a trunk light enough to run three times a frame.

    stride  2 ── 4 ── 8 ───────────────────────────── + ── conv ──> head, a cell of 8 pixels
                      │                               ^
                     16 ──────────── + ── conv ── up ─┘
                      │              ^
                     32 ── conv ─ up ┘

A cell of 8 pixels sees a car 25 pixels high in KITTI's images, 13 at 192x640, as one and a half cells, and
keeps cars parked side by side apart. Only plain 3x3 convolutions, ReLU and sums: what 8-bit integers do well.
"""

from collections.abc import Sequence

from torch import Tensor, nn
from torchvision.ops import Conv2dNormActivation  # type: ignore[import-untyped]

from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import YoloHead

STRIDE_PX = 8
# Of the 28742 cars in KITTI's 7481 labelled frames, at 192x640: a mean IoU of 0.697.
KITTI_CAR_ANCHORS_PX = ((19.1, 13.4), (37.6, 22.6), (66.8, 36.0), (102.2, 63.1), (165.4, 90.7))
# Nearly all of some ten thousand predictions see nothing; starting at a half, they drown the few that do.
_FIRST_SCORE = 0.02


class Residual(nn.Module):
    """Two units and a way around them."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            Conv2dNormActivation(channels, channels), Conv2dNormActivation(channels, channels)
        )

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps of the same shape."""
        changed: Tensor = maps + self.body(maps)
        return changed


class CompactTrunk(nn.Module):
    """Backbone down to 1/32 of the input, and a neck back up to 1/8."""

    def __init__(
        self,
        channels: int,
        widths: tuple[int, int, int, int, int],
        residuals: tuple[int, int, int],
    ) -> None:
        super().__init__()
        half, quarter, eighth, sixteenth, coarse = widths
        self.eighth = nn.Sequential(
            Conv2dNormActivation(channels, half, stride=2),
            Conv2dNormActivation(half, quarter, stride=2),
            Conv2dNormActivation(quarter, eighth, stride=2),
            *(Residual(eighth) for _ in range(residuals[0])),
        )
        self.sixteenth = _half(eighth, sixteenth, residuals[1])
        self.coarse = _half(sixteenth, coarse, residuals[2])
        self.lift_coarse = _lift(coarse, sixteenth)
        self.join_sixteenth = Conv2dNormActivation(sixteenth, sixteenth)
        self.lift_sixteenth = _lift(sixteenth, eighth)
        self.join_eighth = Conv2dNormActivation(eighth, eighth)
        self.out_channels = eighth

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, out_channels, H / 8, W / 8)."""
        eighth = self.eighth(images)
        sixteenth = self.sixteenth(eighth)
        coarse = self.coarse(sixteenth)
        sixteenth = self.join_sixteenth(sixteenth + self.lift_coarse(coarse))
        joined: Tensor = self.join_eighth(eighth + self.lift_sixteenth(sixteenth))
        return joined


class CompactDetector(YoloDetector):
    """The default detector."""

    def __init__(
        self,
        class_names: Sequence[str] = ("Car",),
        anchors_px: Sequence[tuple[float, float]] = KITTI_CAR_ANCHORS_PX,
        channels: int = 3,
        widths: tuple[int, int, int, int, int] = (16, 32, 64, 128, 256),
        residuals: tuple[int, int, int] = (2, 2, 1),
    ) -> None:
        """Build it with random weights.

        Args:
            class_names: Classes to detect.
            anchors_px: Widths and heights of the anchors in pixels of the input.
            channels: 3, or 1 for maps.
            widths: Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the input.
            residuals: Number of residual blocks at 1/8, 1/16 and 1/32.
        """
        trunk = CompactTrunk(channels, widths, residuals)
        head = YoloHead(trunk.out_channels, STRIDE_PX, anchors_px, class_names, _FIRST_SCORE)
        super().__init__(channels, trunk, head)


def _half(channels_in: int, channels_out: int, residuals: int) -> nn.Sequential:
    """Return what brings a map to half its size."""
    rest = [Residual(channels_out) for _ in range(residuals)]
    return nn.Sequential(Conv2dNormActivation(channels_in, channels_out, stride=2), *rest)


def _lift(channels_in: int, channels_out: int) -> nn.Sequential:
    """Return what brings a coarse map to twice its size and to the channels of the finer one."""
    return nn.Sequential(
        nn.Conv2d(channels_in, channels_out, 1, bias=False),
        nn.BatchNorm2d(channels_out),
        nn.Upsample(scale_factor=2, mode="nearest"),
    )
