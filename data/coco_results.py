"""COCO's detections, `[{"image_id": 7, "category_id": 3, "bbox": [left, top, width, height], "score": 0.9}, ...]`.

Images are the frames of KITTI's object labels by their numbers. Categories have the names of a JSON document with
`categories` in the same folder, such as the annotations of the data, else those of COCO.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data.kitti.sensor_files import list_folder
from data.result_files import read_json
from perception.detection.detectors.class_columns import COCO_CLASSES, COCO_NUMBERS, KNOWN_CLASSES
from perception.errors import LabelError
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.protocol import NO_ALPHA_RAD
from perception.types import Float64, Int, Progress

_FIELDS = ("image_id", "category_id", "score")
_MAX_WHOLE = 2**53
# COCO labels a bicycle alone, KITTI a cyclist with it; nothing of COCO's is nearer.
_CLASSES: Mapping[str, str] = {**KNOWN_CLASSES, "bicycle": "Cyclist"}


@dataclass(frozen=True)
class CocoDetections:
    """N detections of a file.

    Attributes:
        path: File.
        images: (N,) numbers of the images.
        types: (N,) class names, as KITTI has them where it has such a class.
        boxes_px: (N, 4) x1 y1 x2 y2.
        scores: (N,) scores.
        note: Sentence on the classes that categories count as.
    """

    path: Path
    images: Int
    types: np.ndarray
    boxes_px: Float64
    scores: Float64
    note: str
    noun: str = "images"

    @property
    def numbers(self) -> Collection[int]:
        """Numbers of the images with detections."""
        return set(self.images.tolist())

    def read(self, chosen: Sequence[int], progress: Progress) -> DetectedBoxes:
        """Return the detections of some frames, in the order of these; the order decides between equal scores."""
        place_of = {number: place for place, number in enumerate(chosen)}
        places = np.array([place_of.get(one, -1) for one in self.images.tolist()], np.int64)
        order = np.argsort(places, kind="stable")
        rows = order[places[order] >= 0]
        return DetectedBoxes(
            frames=places[rows],
            types=self.types[rows],
            alphas_rad=np.full(len(rows), NO_ALPHA_RAD),
            boxes_px=self.boxes_px[rows],
            scores=self.scores[rows],
        )


def parse_coco_detections(path: Path, document: Sequence[Any]) -> CocoDetections:
    """Return the detections of a file that is read.

    Raises:
        LabelError: An entry lacks a number, or has a category without a name.
    """
    numbers = np.array(
        [_numbers(f"{path} [{row}]", one) for row, one in enumerate(document)], np.float64
    ).reshape(-1, len(_FIELDS) + 4)
    names, source = _category_names(path)
    categories = numbers[:, 1].astype(np.int64)
    for row in np.flatnonzero(~np.isin(categories, list(names)))[:1].tolist():
        raise LabelError(
            f"{path} [{row}] category_id",
            expected=f"a category of {source}",
            found=str(categories[row]),
            advice="put a JSON file with `categories` beside the results",
        )
    present = np.unique(categories).tolist()
    known = {number: _CLASSES.get(names[number].lower(), names[number]) for number in present}
    left_top = numbers[:, 3:5]
    described = ", ".join(f"{number} {names[number]} as {known[number]}" for number in present)
    return CocoDetections(
        path=path,
        images=numbers[:, 0].astype(np.int64),
        types=np.array([known[number] for number in categories.tolist()], np.str_),
        boxes_px=np.hstack([left_top, left_top + numbers[:, 5:7]]),
        scores=numbers[:, 2],
        note=f"categories of {source}: {described or 'none'}",
    )


def _numbers(where: str, entry: Any) -> list[float]:  # noqa: ANN401 - whatever the file holds
    """Return image, category, score, left, top, width and height of an entry."""
    box = entry.get("bbox") if isinstance(entry, dict) else None
    if not isinstance(box, list) or len(box) != 4:
        expected = "an object with image_id, category_id, bbox of 4 numbers and score"
        raise LabelError(where, expected=expected, found=_short(entry))
    values = [*((name, entry.get(name)) for name in _FIELDS), *(("bbox", one) for one in box)]
    for place, (name, value) in enumerate(values):
        is_number = type(value) in (int, float) and abs(value) <= _MAX_WHOLE
        if not is_number or (place < 2 and value != int(value)) or (place > 4 and value < 0):
            kind = (
                "a whole number" if place < 2 else "a size from 0 on" if place > 4 else "a number"
            )
            raise LabelError(f"{where} {name}", expected=kind, found=_short(value))
    return [float(value) for _, value in values]


def _category_names(path: Path) -> tuple[dict[int, str], str]:
    """Return the names of categories by number, and where they stand."""
    for other in sorted(list_folder(path.parent)):
        if other.suffix == ".json" and other != path and b'"categories"' in other.read_bytes():
            document = read_json(other)
            listed = document.get("categories") if isinstance(document, dict) else None
            if isinstance(listed, list):
                return dict(
                    _category(f"{other} categories[{n}]", one) for n, one in enumerate(listed)
                ), str(other)
    return dict(zip(COCO_NUMBERS, COCO_CLASSES, strict=True)), "COCO"


def _category(where: str, entry: Any) -> tuple[int, str]:  # noqa: ANN401 - whatever the file holds
    number, name = (entry.get("id"), entry.get("name")) if isinstance(entry, dict) else (None, None)
    if not isinstance(number, int) or not isinstance(name, str):
        raise LabelError(where, expected="a whole id and a name", found=_short(entry))
    return number, name


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]} ..."
