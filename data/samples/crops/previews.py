"""Crops as image grids that show what each augmentation does to them.

         sample 1   sample 2   sample 3 ...
plain    +------+   +------+
draw 1   |      |   |      |              the label's box in green
draw 2   +------+   +------+
"""

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from data.samples.crops.config import OPERATIONS, CropAugmentationConfig
from data.samples.crops.dataset import CropDataset
from data.samples.crops.transforms import CropTransform, crop_view, draw_transform
from perception.maps.encoding import decode_depth
from perception.types import Float, UInt8

_BOX_RGB = (0, 255, 0)
_GAP_PX = 2
_DRAWS = 6  # augmented rows below the unchanged one
_SCALE = 2  # of the previews over the crops
_ROAD, _MAN_HIGH = 52, 90  # the road, and 1.8 m above it, as the image encodes heights


def augmentation_previews(
    dataset: CropDataset, magnitudes: CropAugmentationConfig, rows: Sequence[int]
) -> Mapping[str, UInt8]:
    """Return an (H, W, 3) RGB image for `none`, for each operation alone, and for `all`.

    Args:
        dataset: Dataset of the samples.
        magnitudes: Magnitudes of the operations.
        rows: Rows of the samples, one for each column.
    """
    chosen = {"none": CropAugmentationConfig.none()}
    chosen |= {operation: magnitudes.only(operation) for operation in OPERATIONS}
    chosen["all"] = magnitudes
    return {name: _grid(dataset, one, rows) for name, one in chosen.items()}


def preview_rows(dataset: CropDataset, count: int) -> list[int]:
    """Draw samples to preview, vehicles first, then as many others."""
    rng = np.random.default_rng(0)
    is_vehicle = dataset.crops.is_vehicle
    classes = [np.flatnonzero(is_vehicle), np.flatnonzero(~is_vehicle)]
    counts = [(count + 1) // 2, count // 2]
    return [
        int(row)
        for of_class, number in zip(classes, counts, strict=True)
        for row in rng.choice(of_class, min(number, len(of_class)), replace=False)
    ]


def render_crop(crop: UInt8, normalized_box: Float, depth_m: float) -> UInt8:
    """Return an RGB image of a (66, 112, 3) crop, twice its size, with the box of a vehicle.

    Points at the object's depth are half bright, nearer ones darker; the road is blue, higher points
    turn yellow; high reflectance is a little brighter, and unknown is black.

    Args:
        crop: Channels depth, height and reflectance.
        normalized_box: (4,) box of the label, 0..1 over the crop, NaN where there is none.
        depth_m: Depth of the object.
    """
    crop_m = np.maximum(decode_depth(crop[..., 0]), 1.0)
    light = np.clip(140 + 250 * np.log(crop_m / depth_m), 25, 255) * (crop[..., 1] > 0)
    light *= 0.7 + 0.3 * crop[..., 2] / 255
    warmth = np.clip((crop[..., 1].astype(np.float32) - _ROAD) / _MAN_HIGH, 0, 1)[..., None]
    rgb = light[..., None] * ((1 - warmth) * (0.35, 0.6, 1.0) + warmth * (1.0, 0.85, 0.2))
    image = np.repeat(np.repeat(rgb.astype(np.uint8), _SCALE, axis=0), _SCALE, axis=1)
    if np.isfinite(normalized_box).all():
        edges = np.asarray(normalized_box) * np.tile([image.shape[1], image.shape[0]], 2)
        x1, y1, x2, y2 = np.rint(edges).astype(int).tolist()
        cv2.rectangle(image, (x1, y1), (x2, y2), _BOX_RGB, 1)
    return image


def _grid(dataset: CropDataset, magnitudes: CropAugmentationConfig, rows: Sequence[int]) -> UInt8:
    lines = [[_render_view(dataset, row, CropTransform()) for row in rows]]
    for draw in range(_DRAWS):
        lines.append(
            [
                _render_view(
                    dataset, row, draw_transform(magnitudes, np.random.default_rng([draw, row]))
                )
                for row in rows
            ]
        )
    return np.concatenate([np.concatenate(line, axis=1) for line in lines], axis=0)


def _render_view(dataset: CropDataset, row: int, transform: CropTransform) -> UInt8:
    source = dataset.source(row)
    view = crop_view(dataset.image(row), source, transform, dataset.frames.config.method)
    gap = ((0, _GAP_PX), (0, _GAP_PX), (0, 0))
    return np.pad(
        render_crop(view.crop, view.normalized_box, source.depth_m * transform.depth),
        gap,
        constant_values=255,
    )
