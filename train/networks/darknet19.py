"""Darknet-19 without its classifier: the backbone that YOLOv2 starts from.

Table 6 of Redmon and Farhadi, "YOLO9000: better, faster, stronger", CVPR 2017: 3x3 convolutions that
double the channels after every pooling, with 1x1 convolutions between them that halve the channels.
"""

from torch import Tensor, nn

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
