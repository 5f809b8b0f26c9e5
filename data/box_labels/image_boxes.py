"""Boxes in images: COCO's JSON, and YOLO's text, a file an image; a box is its centre, width and height as shares of the image.

COCO lists the labelled images. Without a file of YOLO's, an image is not labelled; an empty one says that nothing is in it.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    as_stated,
    entry,
    has,
    numbers_of,
    records,
    rounded,
    track_name,
    write_document,
)
from data.kitti.labels import DONT_CARE
from data.kitti.reading import read_text
from data.kitti.rows import to_numbers
from perception.errors import LabelError

_NAME_FILES = ("classes.txt", "obj.names", "data.yaml", "dataset.yaml")
_BOX = 4
_SLACK = 1e-3  # by which a box may reach beyond its image, by rounding


def _box(where: str, kind: str, track: str, shares: Sequence[float]) -> LabelledBox:
    x, y, width, height = shares
    if not -_SLACK <= min(shares) <= max(shares) <= 1 + _SLACK:
        shown = ", ".join(f"{one:g}" for one in shares)
        raise LabelError(where, expected="a box within its image", found=f"shares {shown}")
    return LabelledBox(where, kind, track, (x, y, 0.0, width, height, 1.0, 0.0))


def _read_coco(path: Path, document: Any) -> Frames:  # noqa: ANN401 - a JSON document
    kinds = {
        entry(one, "id", str(path)): str(entry(one, "name", str(path)))
        for one in records(document, "categories", path)
    }
    images = {
        entry(one, "id", f"{path} image {number}"): one
        for number, one in enumerate(records(document, "images", path), start=1)
    }
    names = {
        key: PurePosixPath(str(entry(one, "file_name", f"{path} image {key}"))).stem
        for key, one in images.items()
    }
    frames: dict[str, list[LabelledBox]] = {name: [] for name in names.values()}
    for number, one in enumerate(records(document, "annotations", path), start=1):
        where = f"{path} annotation {number}"
        image = entry(one, "image_id", where)
        size = numbers_of(entry(images, image, where), ("width", "height"), where)
        x, y, width, height = numbers_of(entry(one, "bbox", where), range(_BOX), where)
        edges = np.array([x, y, x + width, y + height]) / np.maximum((*size, *size), 1e-9)
        # Tools let boxes reach over the border.
        x0, y0, x1, y1 = np.clip(edges, 0, 1).tolist()
        kind = entry(kinds, entry(one, "category_id", where), where)
        track = track_name(one.get("track_id", (one.get("attributes") or {}).get("track_id")))
        kind = DONT_CARE if one.get("iscrowd") else kind
        shares = ((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0)
        frames[names[image]].append(_box(where, kind, track, shares))
    return frames


def _is_yolo(text: Any) -> bool:  # noqa: ANN401 - any content
    if not isinstance(text, str):
        return False
    rows = [row for row in map(str.split, text.splitlines()) if row][:3]
    return all(
        row[0].isdecimal()
        and (len(row) in (_BOX + 1, _BOX + 2) or (len(row) % 2 == 1 and len(row) > _BOX + 2))
        and all(_is_share(word) for word in row[1 : _BOX + 1])
        for row in rows
    )


def _is_share(word: str) -> bool:
    number = to_numbers([[word]], 1)[0, 0]
    return bool(np.isnan(number) or -_SLACK <= number <= 1 + _SLACK)


def _read_yolo(path: Path, text: Any) -> Frames:  # noqa: ANN401 - a text
    rows = [(number, row.split()) for number, row in enumerate(text.splitlines(), start=1)]
    kinds, boxes = _class_names(path) if any(row for _, row in rows) else {}, []
    for number, row in rows:
        where = f"{path} row {number}"
        if not row:
            continue
        kind = kinds.get(row[0])
        if kind is None:
            expected = f"a class of {', '.join(kinds)}" if kinds else "names of classes"
            advice = f"write them into {path.parent / _NAME_FILES[0]}, one a line"
            raise LabelError(where, expected=expected, found=row[0], advice=advice)
        numbers = to_numbers([row[1:]], len(row) - 1)[0]
        if len(row) > _BOX + 2:  # an outline
            low, high = numbers.reshape(-1, 2).min(axis=0), numbers.reshape(-1, 2).max(axis=0)
            numbers = np.concatenate([(low + high) / 2, high - low])
        boxes.append(_box(where, kind, "", numbers[:_BOX].tolist()))
    return {"": boxes}


def _class_names(path: Path) -> Mapping[str, str]:
    """Return the name of each number of a class, of a list beside the labels or in one of two folders above."""
    file = next(_name_files(path), None)
    if file is None:
        return {}
    text = read_text(file, LabelError, "names of classes")
    if file.suffix != ".yaml":
        return {str(number): line.strip() for number, line in enumerate(text.splitlines())}
    import yaml

    from perception.yaml_text import read_yaml

    try:
        names = entry(read_yaml(text), "names", str(file))
    except yaml.YAMLError as error:
        raise LabelError(file, expected="YAML", found=" ".join(str(error).split())) from error
    named = names.items() if isinstance(names, Mapping) else enumerate(names or ())
    return {str(number): str(name) for number, name in named}


def _name_files(path: Path) -> Iterator[Path]:
    for folder in path.resolve().parents[:3]:
        yield from (folder / name for name in _NAME_FILES if (folder / name).is_file())


_READINGS = (Reading("shares of the image", as_stated),)


def _write_coco(out: Path, frames: Sequence[LabelledFrame]) -> None:
    kinds = _kinds(frames)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for frame in frames:
        if frame.image is None:
            continue
        width, height = frame.size_px
        number = len(images) + 1
        images.append({"id": number, "file_name": frame.image, "width": width, "height": height})
        for box in frame.image_boxes:
            x, y, _, across, down, _, _ = box.numbers
            edges = rounded(
                ((x - across / 2) * width, (y - down / 2) * height, across * width, down * height)
            )
            annotation = {
                "id": len(annotations) + 1, "image_id": number, "category_id": kinds.index(box.kind) + 1,
                "bbox": edges, "area": round(edges[2] * edges[3], 2), "iscrowd": 0,
            }  # fmt: skip
            annotations.append({**annotation, "track_id": box.track} if box.track else annotation)
    categories = [{"id": number, "name": kind} for number, kind in enumerate(kinds, start=1)]
    document = {"images": images, "annotations": annotations, "categories": categories}
    write_document(out / "instances.json", document)


def _write_yolo(out: Path, frames: Sequence[LabelledFrame]) -> None:
    kinds = _kinds(frames)
    for frame in frames:
        if frame.image is not None:
            rows = (
                (kinds.index(b.kind), *(f"{b.numbers[k]:.6f}" for k in (0, 1, 3, 4)))
                for b in frame.image_boxes
            )
            text = "".join(f"{' '.join(map(str, row))}\n" for row in rows)
            write_document(out / f"{PurePosixPath(frame.image).stem}.txt", text)
    write_document(out / _NAME_FILES[0], "".join(f"{kind}\n" for kind in kinds))


def _kinds(frames: Sequence[LabelledFrame]) -> list[str]:
    return sorted({box.kind for frame in frames for box in frame.image_boxes})


COCO = LabelForm(
    "COCO",
    lambda document: has(document, "images", "annotations", "categories"),
    _read_coco,
    _READINGS,
    _write_coco,
    names_frames=True,
    is_of_image=True,
)
YOLO = LabelForm(
    "YOLO", _is_yolo, _read_yolo, _READINGS, _write_yolo, is_per_scan=True, is_of_image=True
)
