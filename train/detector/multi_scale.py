"""Multi-scale training: several input sizes, so that the network learns objects at several scales.

Every tenth batch draws a new size, as in Redmon and Farhadi, "YOLO9000: better, faster, stronger", CVPR 2017,
"Multi-scale training". There all are square; here they keep the shape of the size that the detector is for.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from torch import Tensor
from torch.nn import functional

from perception.detection.detectors.input_size import SIZE_STEP_PX, InputSize
from perception.errors import UsageError
from train.detector.targets import BatchLabels

Interpolation = Literal["nearest", "bilinear"]


def scaled_sizes(
    size: InputSize, smallest: float = 0.75, largest: float = 1.25
) -> tuple[InputSize, ...]:
    """Return sizes of about the same shape, each height that is a multiple of 32 within the scales.

    >>> [tuple(scaled) for scaled in scaled_sizes(InputSize(192, 640), 0.8, 1.2)]
    [(160, 544), (192, 640), (224, 736)]
    """
    first = int(np.ceil(size.height_px * smallest / SIZE_STEP_PX))
    last = int(np.floor(size.height_px * largest / SIZE_STEP_PX))
    if first > last or first < 1:
        raise UsageError(
            "input scales",
            expected=f"scales of {size.height_px} rows that hold a multiple of {SIZE_STEP_PX}",
            found=f"{smallest:g} to {largest:g}",
        )
    per_row = size.width_px / size.height_px
    return tuple(
        InputSize(SIZE_STEP_PX * n, SIZE_STEP_PX * round(n * per_row))
        for n in range(first, last + 1)
    )


def size_of_batch(sizes: Sequence[InputSize], batch_index: int, seed: int) -> InputSize:
    """Return the size of one batch, another for every ten: a matter of its number alone, so that resumed training draws the same."""
    rng = np.random.default_rng([seed, batch_index // 10])
    return sizes[int(rng.integers(len(sizes)))]


def resize_images(images: Tensor, size: InputSize, interpolation: Interpolation) -> Tensor:
    """Return float images (B, C, H, W) of another size.

    Args:
        images: Images of 0..255.
        size: Size to return.
        interpolation: `nearest` for maps, where a mean of two depths is a place where nothing is.
    """
    if interpolation == "nearest":
        return functional.interpolate(images.float(), size, mode="nearest-exact")
    return functional.interpolate(images.float(), size, mode="bilinear", antialias=True)


def resize_labels(labels: BatchLabels, before: InputSize, after: InputSize) -> BatchLabels:
    """Return the labels of images whose size has changed."""
    across, down = after.width_px / before.width_px, after.height_px / before.height_px
    scale = labels.boxes_px.new_tensor([across, down, across, down])
    return labels._replace(boxes_px=labels.boxes_px * scale)
