"""What tells the form of a network's outputs: their names and shapes, and what the file's metadata say beside them.

Coefficients of masks and coordinates of keypoints follow the scores of the classes; outputs of four and more axes are
masks or the maps of each stride, which hold the boxes once more.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from perception.detection.detectors.input_size import InputSize
from perception.detection.onnx_model import Array
from perception.types import Float32

Outputs = Mapping[str, Array]

STRIDES_PX = (8, 16, 32)
# Strides of networks for larger objects, for smaller ones, and of two layers.
_OTHER_STRIDES_PX = ((8, 16, 32, 64), (4, 8, 16, 32), (16, 32))
_ANCHORS = (1, 3)  # boxes of each cell
# Logits of COCO's classes, by their order or their numbers, and of no object.
_WITH_NO_OBJECT = (81, 92)
# Names by which exporters call the outputs of a suppression within the network.
_SYNONYMS: Mapping[str, str] = {
    "num_dets": "count",
    "num_detections": "count",
    "det_boxes": "boxes",
    "detection_boxes": "boxes",
    "det_scores": "scores",
    "detection_scores": "scores",
    "det_classes": "labels",
    "detection_classes": "labels",
    "dets": "pred_boxes",
    "pred_logits": "logits",
}


def with_known_names(outputs: Outputs) -> Outputs:
    """Return outputs with one name for each meaning."""
    plain = ((name.removesuffix(":0"), array) for name, array in outputs.items())
    return {_SYNONYMS.get(name, name): array for name, array in plain}


def of_first_image(array: Array, axes: int) -> Array:
    """Return the part of the first image of an output that has a number of axes for each image."""
    return np.asarray(array[0] if array.ndim > axes else array)


def tables(outputs: Outputs) -> list[Array]:
    """Return the outputs that may hold a row or column for each box, with or without an axis for the images."""
    return [array for array in outputs.values() if array.ndim in (2, 3)]


@dataclass(frozen=True)
class NetworkOutputs:
    """Outputs of a network for a blank image, and what is known of them.

    Attributes:
        arrays: Outputs by their known names.
        has_sizes: Whether the size of the image is an input, too.
        size: Size of the image.
        named_classes: Number of classes that the file or its description names, 0 where they name none.
        keypoint_columns: Numbers that the keypoints of each box are.
    """

    arrays: Outputs
    has_sizes: bool
    size: InputSize
    named_classes: int = 0
    keypoint_columns: int = 0

    def has(self, *names: str) -> bool:
        """Return whether there are outputs of these names."""
        return self.arrays.keys() >= {*names}

    @property
    def table(self) -> tuple[int, ...]:
        """Shape of the only table, with or without an axis for the images; zeros where there is no or a second table."""
        found = tables(self.arrays)
        return found[0].shape if len(found) == 1 else (0, 0)

    @property
    def further_columns(self) -> int:
        """Columns behind those of the classes: coefficients of masks, as many as an output has maps, and keypoints."""
        maps = [array.shape[1] for array in self.arrays.values() if array.ndim == 4]
        return self.keypoint_columns + (maps[0] if len(maps) == 1 else 0)

    @property
    def logit_columns(self) -> int:
        """Columns of the classes' logits, 0 where there are none."""
        logits = self.arrays.get("logits", self.arrays.get("labels"))
        return int(logits.shape[-1]) if logits is not None and logits.ndim == 3 else 0

    @property
    def logit_classes(self) -> int:
        """Number of classes that have logits, without that of no object, which comes last."""
        columns, named = self.logit_columns, self.named_classes
        return columns - (columns == named + 1 if named else columns in _WITH_NO_OBJECT)

    def is_dense(self, length: int) -> bool:
        """Return whether a number of boxes is that of all cells of the input."""
        cells = [cell_count(self.size, strides) for strides in (STRIDES_PX, *_OTHER_STRIDES_PX)]
        return length in [anchors * count for anchors in _ANCHORS for count in cells]

    @property
    def has_offsets(self) -> bool:
        """Whether there is one row for each cell whose center is within it, and not in pixels of the whole input."""
        is_cell = self.table[-2:-1] == (cell_count(self.size, STRIDES_PX),)
        return is_cell and bool(
            np.abs(tables(self.arrays)[0][..., :2]).max(initial=0) < max(self.size) / 2
        )

    @property
    def has_class_numbers(self) -> bool:
        """Whether the sixth column of the only table holds numbers of classes, and not scores of one, in its first image."""
        table = tables(self.arrays)[0]
        column = table[:1, :, 5] if table.ndim == 3 else table[..., 5]
        return bool((column == np.rint(column)).all())


def cell_count(size: InputSize, strides_px: tuple[int, ...]) -> int:
    """Return the number of cells of an input."""
    return sum((size.height_px // stride) * (size.width_px // stride) for stride in strides_px)


@lru_cache(maxsize=8)
def cells_px(size: InputSize) -> Float32:
    """Return column, row and size of each cell of an input, the smallest first, row after row."""
    parts = []
    for stride in STRIDES_PX:
        rows, columns = np.indices((size.height_px // stride, size.width_px // stride))
        parts.append(np.stack([columns, rows, np.full_like(rows, stride)], axis=-1).reshape(-1, 3))
    return np.concatenate(parts).astype(np.float32)
