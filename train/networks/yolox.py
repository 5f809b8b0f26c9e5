"""YOLOX-nano: an anchor-free detector of about a million weights, which starts from public ones.

    stride  2 ── 4 ── 8 ───────────────────────── + ── 8 ──────> head
                      │                           ^    └── + ── 16 ──> head
                     16 ──────── + ── reduce ── up         ^    └── + ── 32 ──> head
                      │          ^       └─────────────────┘        ^
                     32 ── reduce ── up                             │
                              └─────────────────────────────────────┘

Ge et al., "YOLOX: exceeding YOLO series in 2021", arXiv 2107.08430. A convolution has a bias and no batch norm: that
of the public weights is folded into them, and its statistics of photographs stay whatever a training shows.
Modules are created in the order in which the public file computes its convolutions.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import DecodedBoxes, DetectionHead, logit, require_classes

STRIDES_PX = (8, 16, 32)
BOX, OBJECTNESS, CLASSES = slice(0, 4), 4, slice(5, None)
_WIDTHS = (64, 128, 256)  # channels at the strides
_POOLED_CELLS = 5
_FIRST_SCORE = 0.01
# exp of more would only be reached by a network that diverges.
_MAX_LOG_CELLS = 8.0


class SiluUnit(nn.Sequential):
    """Convolution with a bias, SiLU."""

    def __init__(
        self, channels_in: int, channels_out: int, kernel: int = 1, stride: int = 1, groups: int = 1
    ) -> None:
        padding = (kernel - 1) // 2
        super().__init__(
            nn.Conv2d(channels_in, channels_out, kernel, stride, padding, groups=groups),
            nn.SiLU(),
        )


class SeparableUnit(nn.Sequential):
    """Depthwise 3x3 unit and pointwise unit."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1) -> None:
        super().__init__(
            SiluUnit(channels_in, channels_in, 3, stride, groups=channels_in),
            SiluUnit(channels_in, channels_out),
        )


class Bottleneck(nn.Module):
    """Pointwise and separable unit, with a way around them or without."""

    def __init__(self, channels: int, *, has_shortcut: bool) -> None:
        super().__init__()
        self.body = nn.Sequential(SiluUnit(channels, channels), SeparableUnit(channels, channels))
        self.has_shortcut = has_shortcut

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps of the same shape."""
        changed: Tensor = self.body(maps)
        return changed + maps if self.has_shortcut else changed


class CspStage(nn.Module):
    """Cross stage partial connections: half of the channels pass the bottlenecks, half go around them."""

    def __init__(
        self, channels_in: int, channels_out: int, bottlenecks: int = 1, *, has_shortcut: bool
    ) -> None:
        super().__init__()
        half = channels_out // 2
        self.changed = SiluUnit(channels_in, half)
        self.passed = SiluUnit(channels_in, half)
        self.bottlenecks = nn.Sequential(
            *(Bottleneck(half, has_shortcut=has_shortcut) for _ in range(bottlenecks))
        )
        self.joined = SiluUnit(channels_out, channels_out)

    def forward(self, maps: Tensor) -> Tensor:
        """Return (B, channels_out, rows, columns)."""
        halves = [self.bottlenecks(self.changed(maps)), self.passed(maps)]
        joined: Tensor = self.joined(torch.cat(halves, dim=1))
        return joined


class PyramidPooling(nn.Module):
    """Maxima over 5, 9 and 13 cells beside the map itself; one of 5 after another sees 4 cells more."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.reduced = SiluUnit(channels, channels // 2)
        self.pooled = nn.MaxPool2d(_POOLED_CELLS, stride=1, padding=_POOLED_CELLS // 2)
        self.joined = SiluUnit(2 * channels, channels)

    def forward(self, maps: Tensor) -> Tensor:
        """Return maps of the same shape."""
        scales = [self.reduced(maps)]
        for _ in range(3):
            scales.append(self.pooled(scales[-1]))
        joined: Tensor = self.joined(torch.cat(scales, dim=1))
        return joined


class YoloxTrunk(nn.Module):
    """Backbone down to 1/32 of the input, a neck up to 1/8, and down to 1/32 again."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        fine, middle, coarse = _WIDTHS
        # 3x3 over blocks of 2x2 pixels, as published, is 6x6 over pixels.
        self.stem = nn.Sequential(nn.Conv2d(channels, fine // 4, 6, 2, padding=2), nn.SiLU())
        self.quarter = _half(fine // 4, fine // 2, 1)
        self.eighth = _half(fine // 2, fine, 3)
        self.sixteenth = _half(fine, middle, 3)
        self.coarse = nn.Sequential(
            SeparableUnit(middle, coarse, 2),
            PyramidPooling(coarse),
            CspStage(coarse, coarse, has_shortcut=False),
        )
        self.reduce_coarse = SiluUnit(coarse, middle)
        self.join_sixteenth = CspStage(2 * middle, middle, has_shortcut=False)
        self.reduce_sixteenth = SiluUnit(middle, fine)
        self.join_eighth = CspStage(2 * fine, fine, has_shortcut=False)
        self.down_eighth = SeparableUnit(fine, fine, 2)
        self.path_sixteenth = CspStage(middle, middle, has_shortcut=False)
        self.down_sixteenth = SeparableUnit(middle, middle, 2)
        self.path_coarse = CspStage(coarse, coarse, has_shortcut=False)
        self.lift = nn.Upsample(scale_factor=2, mode="nearest")

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return maps of 64, 128 and 256 channels at strides of 8, 16 and 32 pixels."""
        eighth = self.eighth(self.quarter(self.stem(images)))
        sixteenth = self.sixteenth(eighth)
        coarse = self.reduce_coarse(self.coarse(sixteenth))
        up = self.join_sixteenth(torch.cat([self.lift(coarse), sixteenth], dim=1))
        up = self.reduce_sixteenth(up)
        fine = self.join_eighth(torch.cat([self.lift(up), eighth], dim=1))
        middle = self.path_sixteenth(torch.cat([self.down_eighth(fine), up], dim=1))
        deep = self.path_coarse(torch.cat([self.down_sixteenth(middle), coarse], dim=1))
        return fine, middle, deep


class LevelHead(nn.Module):
    """Decoupled head of one stride: classes by one branch, box and objectness by the other."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        width = _WIDTHS[0]
        self.stem = SiluUnit(channels, width)
        self.class_branch = nn.Sequential(SeparableUnit(width, width), SeparableUnit(width, width))
        self.classes = nn.Conv2d(width, classes, 1)
        self.box_branch = nn.Sequential(SeparableUnit(width, width), SeparableUnit(width, width))
        self.box = nn.Conv2d(width, 4, 1)
        self.objectness = nn.Conv2d(width, 1, 1)
        for part in (self.objectness, self.classes):
            assert part.bias is not None  # every prediction has one
            nn.init.constant_(part.bias, logit(_FIRST_SCORE))

    def forward(self, features: Tensor) -> Tensor:
        """Return raw predictions (B, 5 + classes, rows, columns)."""
        stem = self.stem(features)
        around = self.box_branch(stem)
        classes = self.classes(self.class_branch(stem))
        return torch.cat([self.box(around), self.objectness(around), classes], dim=1)


class YoloxHead(DetectionHead[tuple[Tensor, ...]]):
    """Predict one box in each cell of each stride; there are no anchors.

    Attributes:
        class_names: Classes in the order of the raw channels.
        anchors_px: (0, 2).
    """

    def __init__(self, class_names: Sequence[str]) -> None:
        """Build it with random weights.

        Args:
            class_names: Classes to detect.
        """
        super().__init__()
        require_classes(class_names)
        self.class_names = tuple(class_names)
        self.register_buffer("anchors_px", torch.zeros(0, 2), persistent=False)
        self.levels = nn.ModuleList(LevelHead(width, len(class_names)) for width in _WIDTHS)

    def forward(self, features: Sequence[Tensor]) -> tuple[Tensor, ...]:
        """Return raw predictions (B, 5 + classes, rows, columns) of each stride."""
        return tuple(level(maps) for level, maps in zip(self.levels, features, strict=True))

    def decode(self, raw: tuple[Tensor, ...]) -> DecodedBoxes:
        """Decode raw predictions in float32; K runs over strides, rows, columns."""
        flat = flatten_levels(raw)
        scores = flat[..., OBJECTNESS, None].sigmoid() * flat[..., CLASSES].sigmoid()
        return DecodedBoxes(self.decode_boxes(raw), scores)

    def decode_boxes(self, raw: tuple[Tensor, ...]) -> Tensor:
        """Return (B, K, 4) x1 y1 x2 y2 in pixels of the input.

        Offsets of the centre from the cell's corner in cells, and logarithms of width and height in cells.
        """
        flat, (corners, strides_px) = flatten_levels(raw)[..., BOX], cells(raw)
        centers = (flat[..., :2] + corners) * strides_px
        halves = flat[..., 2:].clamp(-_MAX_LOG_CELLS, _MAX_LOG_CELLS).exp() * strides_px / 2
        return torch.cat([centers - halves, centers + halves], dim=-1)


class YoloxNano(YoloDetector):
    """YOLOX-nano for any class list, of images or maps."""

    def __init__(self, class_names: Sequence[str] = ("Car",), channels: int = 3) -> None:
        """Build it with random weights.

        Args:
            class_names: Classes to detect.
            channels: 3, or 1 for maps.
        """
        super().__init__(channels, YoloxTrunk(channels), YoloxHead(class_names))


def flatten_levels(raw: Sequence[Tensor]) -> Tensor:
    """Return (B, K, values) float32 of the maps (B, values, rows, columns) of all strides."""
    return torch.cat([maps.float().flatten(2) for maps in raw], dim=2).transpose(1, 2)


def cells(raw: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
    """Return the (K, 2) column and row of every cell and the (K, 1) stride in pixels."""
    corners, strides = [], []
    for maps, stride_px in zip(raw, STRIDES_PX, strict=True):
        rows, columns = maps.shape[-2:]
        y = torch.arange(rows, device=maps.device, dtype=torch.float32)[:, None].expand(
            rows, columns
        )
        x = torch.arange(columns, device=maps.device, dtype=torch.float32).expand(rows, columns)
        corners.append(torch.stack([x, y], dim=-1).reshape(-1, 2))
        strides.append(torch.full_like(corners[-1][:, :1], stride_px))
    return torch.cat(corners), torch.cat(strides)


def _half(channels_in: int, channels_out: int, bottlenecks: int) -> nn.Sequential:
    """Return what brings a map to half its size."""
    return nn.Sequential(
        SeparableUnit(channels_in, channels_out, 2),
        CspStage(channels_out, channels_out, bottlenecks, has_shortcut=True),
    )
