"""COCO's detections, `[{"image_id": 7, "category_id": 3, "bbox": [left, top, width, height], "score": 0.9}, ...]`.

Categories have the names of a JSON document with `categories` in the same folder, such as the annotations of the data,
else those of COCO. Images are the frames of KITTI's object labels by their numbers; where that document lists `images`,
by the numbers in their file names.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data.kitti.reading import read_bytes
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
        noun: What the numbers of frames are called.
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
    beside = _document_beside(path)
    names, frame_of = _category_names(beside), _frames_of_images(beside)
    source = "COCO" if beside is None else str(beside.path)
    images, categories = numbers[:, 0].astype(np.int64), numbers[:, 1].astype(np.int64)
    for row in np.flatnonzero(~np.isin(categories, list(names)))[:1].tolist():
        raise LabelError(
            f"{path} [{row}] category_id",
            expected=f"a category of {source}",
            found=str(categories[row]),
            advice="put a JSON file with `categories` beside the results",
        )
    if frame_of is not None:
        for row in np.flatnonzero(~np.isin(images, list(frame_of)))[:1].tolist():
            raise LabelError(
                f"{path} [{row}] image_id", expected=f"an image of {source}", found=str(images[row])
            )
        images = np.array([frame_of[one] for one in images.tolist()], np.int64)
    present = np.unique(categories).tolist()
    known = {number: _CLASSES.get(names[number].lower(), names[number]) for number in present}
    left_top = numbers[:, 3:5]
    described = ", ".join(f"{number} {names[number]} as {known[number]}" for number in present)
    return CocoDetections(
        path=path,
        images=images,
        types=np.array([known[number] for number in categories.tolist()], np.str_),
        boxes_px=np.hstack([left_top, left_top + numbers[:, 5:7]]),
        scores=numbers[:, 2],
        note=f"categories{'' if frame_of is None else ' and images'} of {source}: {described or 'none'}",
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


@dataclass(frozen=True)
class _Document:
    """A document that lists categories, and may list images."""

    path: Path
    categories: Sequence[Any]
    images: Sequence[Any] | None

    def entries(self, field: str, key: str, kind: str) -> dict[int, str]:
        """Return the text of each entry of a field by its id.

        Raises:
            LabelError: An entry has none.
        """
        found = {}
        for number, one in enumerate(getattr(self, field)):
            text = one.get(key) if isinstance(one, dict) else None
            if not isinstance(text, str) or not isinstance(one.get("id"), int):
                where, expected = f"{self.path} {field}[{number}]", f"a whole id and {kind}"
                raise LabelError(where, expected=expected, found=_short(one))
            found[one["id"]] = text
        return found


def _document_beside(path: Path) -> _Document | None:
    """Return the first document in the folder of a file that lists categories, or None."""
    for other in sorted(list_folder(path.parent)):
        is_other = other.suffix == ".json" and other != path and other.is_file()
        if is_other and b'"categories"' in read_bytes(other, LabelError, "a document of COCO"):
            document = read_json(other)
            fields = document if isinstance(document, dict) else {}
            listed, images = fields.get("categories"), fields.get("images")
            if isinstance(listed, list):
                return _Document(other, listed, images if isinstance(images, list) else None)
    return None


def _category_names(beside: _Document | None) -> dict[int, str]:
    if beside is None:
        return dict(zip(COCO_NUMBERS, COCO_CLASSES, strict=True))
    return beside.entries("categories", "name", "a name")


def _frames_of_images(beside: _Document | None) -> dict[int, int] | None:
    """Return the number in the file name of each image; None where a document lists none."""
    if beside is None or not beside.images:
        return None
    files = beside.entries("images", "file_name", "a file_name")
    for number, file in files.items():
        if not re.fullmatch(r"[0-9]{1,18}", Path(file).stem):
            raise LabelError(
                f"{beside.path} image {number}",
                expected="a file_name with the number of a frame, such as 000007.png",
                found=repr(file),
                advice="or list categories alone, and count images as frames",
            )
    return {number: int(Path(file).stem) for number, file in files.items()}


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:80]} ..."
