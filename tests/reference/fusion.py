"""Tri-boxes and their 23 features by plain loops, as 6.2.4 describes them: reference of the vectorised ones."""

from itertools import product

import numpy as np

from benchmarks.reference import overlap
from perception.detection.config import TriBoxConfig
from perception.detection.fusion.detected_scene import DetectedScene
from perception.types import MODALITIES, Detections, Float64, Int

# A box: column of its modality, row within it.
Box = tuple[int, int]


def reference_tri_boxes(scene: DetectedScene, config: TriBoxConfig) -> Int:
    """Return (T, 3) combinations in rising order."""
    parts = _parts(scene)
    boxes = [(column, row) for column, part in enumerate(parts) for row in range(len(part))]
    iou = {(a, b): overlap.iou(_edges(parts, a), _edges(parts, b)) for a in boxes for b in boxes}
    links = {
        a: [b for b in boxes if iou[a, b] > config.min_iou and _type(parts, a) == _type(parts, b)]
        for a in boxes
    }
    rows: set[tuple[int, ...]] = set()
    for box in boxes:
        together = _connected(box, links) if config.by_set else set(links[box]) | {box}
        choices: list[list[int]] = []
        for column in range(len(MODALITIES)):
            others = [other for other in together if other[0] == column]
            others.sort(key=lambda b: (-iou[box, b], -float(parts[b[0]].scores[b[1]]), b[1]))
            chosen = [row for _, row in others[: config.max_partners or None]] or [-1]
            choices.append([box[1]] if column == box[0] else chosen)
        rows.update(product(*choices))
    return np.array(sorted(rows), np.int64).reshape(-1, len(MODALITIES))


def reference_features(scene: DetectedScene, tri_boxes: Int) -> Float64:
    """Return (T, 23) features (6.4)."""
    parts, (width, height) = _parts(scene), scene.size_px
    features = []
    for rows in tri_boxes.tolist():
        seen = [(column, row) for column, row in enumerate(rows) if row >= 0]
        scores, shapes = [0.0] * 3, [[0.0] * 4] * 3
        for column, row in seen:
            x1, y1, x2, y2 = _edges(parts, (column, row))
            scores[column] = float(parts[column].scores[row])
            shapes[column] = _shape((x1 / width, y1 / height, x2 / width, y2 / height))
        x = [shapes[column][2] for column, _ in seen]
        y = [shapes[column][3] for column, _ in seen]
        edges = np.array([_edges(parts, box) for box in seen])
        x1, y1 = edges[:, :2].min(axis=0).tolist()
        x2, y2 = edges[:, 2:].max(axis=0).tolist()
        around = _shape((x1 / width, y1 / height, x2 / width, y2 / height))
        spread = [float(np.mean(x)), float(np.mean(y)), float(np.std(x)), float(np.std(y))]
        features.append(
            [*scores, *(number for shape in shapes for number in shape), *spread, *around]
        )
    return np.array(features).reshape(-1, 23)


def _parts(scene: DetectedScene) -> list[Detections]:
    return [scene.modality_detections.get(modality, Detections.empty()) for modality in MODALITIES]


def _connected(box: Box, links: dict[Box, list[Box]]) -> set[Box]:
    found, ahead = {box}, [box]
    while ahead:
        for other in links[ahead.pop()]:
            if other not in found:
                found.add(other)
                ahead.append(other)
    return found


def _edges(parts: list[Detections], box: Box) -> tuple[float, float, float, float]:
    x1, y1, x2, y2 = parts[box[0]].boxes_px[box[1]].tolist()
    return x1, y1, x2, y2


def _type(parts: list[Detections], box: Box) -> str:
    return str(parts[box[0]].types[box[1]])


def _shape(edges: tuple[float, float, float, float]) -> list[float]:
    x1, y1, x2, y2 = edges
    return [x2 - x1, y2 - y1, (x1 + x2) / 2, (y1 + y2) / 2]
