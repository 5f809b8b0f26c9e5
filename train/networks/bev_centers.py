"""The detector of the bird's-eye view: anchor-free centres on a map of a scan from above.

    cells  4x4 ───── 4 ────────────── + ──> heads, four places of 2 cells each
                     │                ^
                     8 ──────── + ─ up ┘
                     │          ^
                    16 ──── + ─ up
                     │      ^
                    32 ─ up ┘

Yin et al., "Center-based 3D object detection and tracking", CVPR 2021, with heads for the scale of each error.
Separable 3x3 units with ReLU, which 8-bit integers do well.
"""

import math
from collections.abc import Iterator, Sequence
from copy import deepcopy
from itertools import pairwise
from typing import NamedTuple, Self

import torch
from torch import Tensor, nn
from torchvision.ops import Conv2dNormActivation  # type: ignore[import-untyped]

from perception.detection.bev.bev_map import BLOCK
from perception.detection.bev.boxes import BOX, BOXES, DEVIATIONS, SPLIT

_BLOCK_WIDTH = 32  # numbers that tell of a block of 4x4 cells
_WIDTHS = (32, 64, 128, 128)  # channels at 4, 8, 16 and 32 cells
_UNITS = (1, 2, 3, 2)  # residual units at 4, 8, 16 and 32
_FIRST_SCORE = 0.01
_FIRST_SIZE_M = (4.0, 1.8, 1.6)


class CenterMaps(NamedTuple):
    """Raw predictions, as `perception.detection.bev.boxes` orders them: H x W blocks of S * S places.

    Attributes:
        scores: (B, K S S, H, W) logits of a centre of each class.
        boxes: (B, 16 S S, H, W) box and logarithms of the scales of its errors.
    """

    scores: Tensor
    boxes: Tensor


class Separable(nn.Module):
    """Depthwise 3x3 and pointwise unit, and a way around them where nothing changes its size."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1) -> None:
        super().__init__()
        self.body = nn.Sequential(
            Conv2dNormActivation(channels_in, channels_in, stride=stride, groups=channels_in),
            Conv2dNormActivation(channels_in, channels_out, kernel_size=1),
        )
        self.has_shortcut = stride == 1 and channels_in == channels_out

    def forward(self, maps: Tensor) -> Tensor:
        """Return (B, channels_out, rows, columns)."""
        changed: Tensor = self.body(maps)
        return changed + maps if self.has_shortcut else changed


class BevTrunk(nn.Module):
    """Backbone down to 32 cells, and a neck up to 4."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        widths = _WIDTHS
        self.blocks = nn.Linear(BLOCK**2 * channels, _BLOCK_WIDTH)
        self.scale = 1 / 255
        self.joined = Conv2dNormActivation(_BLOCK_WIDTH, widths[0], kernel_size=1)
        self.quarter = nn.Sequential(*(Separable(widths[0], widths[0]) for _ in range(_UNITS[0])))
        self.down = nn.ModuleList(
            nn.Sequential(Separable(before, after, 2), *(Separable(after, after) for _ in range(units)))
            for (before, after), units in zip(pairwise(widths), _UNITS[1:], strict=True)
        )  # fmt: skip
        self.up = nn.ModuleList(
            nn.Sequential(
                nn.Conv2d(after, before, 1, bias=False),
                nn.BatchNorm2d(before),
                nn.Upsample(scale_factor=2, mode="nearest"),
            )
            for before, after in pairwise(widths)
        )
        self.join = nn.ModuleList(Separable(width, width) for width in widths[:-1])
        self.out_channels = widths[0]

    def forward(self, maps: Tensor) -> Tensor:
        """Return (B, out_channels, R / 4, R / 4) of (B, R / 4, R / 4, 16, C) maps of 8-bit numbers."""
        side = maps.shape[1]
        # Cast last: an exported file of 8 bits multiplies the numbers as they are.
        numbers = maps.reshape(-1, self.blocks.in_features).float() * self.scale
        blocks = self.blocks(numbers).relu()
        blocks = blocks.reshape(-1, side, side, _BLOCK_WIDTH).permute(0, 3, 1, 2)
        levels = [self.quarter(self.joined(blocks))]
        for down in self.down:
            levels.append(down(levels[-1]))
        joined: Tensor = levels.pop()
        for up, join in zip(reversed(self.up), reversed(self.join), strict=True):
            joined = join(levels.pop() + up(joined))
        return joined


class BevCenters(nn.Module):
    """Trunk and heads.

    Attributes:
        class_names: Classes in the order of the scores.
    """

    def __init__(self, class_names: Sequence[str], channels: int) -> None:
        """Build it with random weights.

        Args:
            class_names: Classes to detect.
            channels: Planes of the map.
        """
        super().__init__()
        self.class_names = tuple(class_names)
        self.trunk = BevTrunk(channels)
        width = self.trunk.out_channels
        self.score_head = nn.Sequential(
            Separable(width, width), nn.Conv2d(width, SPLIT**2 * len(class_names), 1)
        )
        self.box_head = nn.Sequential(
            Separable(width, width), nn.Conv2d(width, SPLIT**2 * (BOXES + DEVIATIONS), 1)
        )
        with torch.no_grad():
            _bias(self.score_head).fill_(math.log(_FIRST_SCORE / (1 - _FIRST_SCORE)))
            bias = _bias(self.box_head).zero_().view(-1, SPLIT**2)
            bias[BOX.offset] = 0.5
            bias[BOX.size] = torch.tensor(_FIRST_SIZE_M).log()[:, None]

    def train(self, mode: bool = True) -> Self:
        """Choose the mode; normalisation that an export has folded stays the identity."""
        super().train(mode)
        for norm in _norms(self):
            assert norm.running_var is not None
            norm.train(mode and not torch.equal(norm.running_var, _folded_variance(norm)))
        return self

    def forward(self, maps: Tensor) -> CenterMaps:
        """Return raw predictions for (B, R / 4, R / 4, 16, C) maps of 8-bit numbers."""
        features = self.trunk(maps)
        return CenterMaps(self.score_head(features), self.box_head(features))


def of_whole_numbers(network: BevCenters) -> BevCenters:
    """Return the network in evaluation mode that takes numbers of 8 bits as they are: a pass over the map less."""
    changed = deepcopy(network).eval()
    trunk = changed.trunk
    trunk.blocks.weight.data *= trunk.scale
    trunk.scale = 1.0
    return changed


def fold(network: nn.Module) -> None:
    """Make every normalisation the identity, for weights into which it is folded."""
    for norm in _norms(network):
        norm.reset_parameters()
        norm.running_var = _folded_variance(norm)


def _norms(network: nn.Module) -> Iterator[nn.BatchNorm2d]:
    return (one for one in network.modules() if isinstance(one, nn.BatchNorm2d))


def _folded_variance(norm: nn.BatchNorm2d) -> Tensor:
    assert norm.running_mean is not None
    return torch.full_like(norm.running_mean, 1 - norm.eps)


def _bias(head: nn.Sequential) -> Tensor:
    last: nn.Conv2d = head[-1]  # type: ignore[assignment]
    assert last.bias is not None  # which every prediction has
    return last.bias
