"""Detections of all modalities in one frame, with the depths of their boxes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from perception.geometry.box_overlap_px import iou_px
from perception.maps.densify import DenseMaps
from perception.types import (
    MODALITIES,
    Bool,
    Calibration,
    Detections,
    Float64,
    Int,
    Modality,
    ModalityDetections,
)

_SAMPLES_PER_EDGE = 10  # depth samples along each edge of a box
# Horizontal field of view of a usual car camera, where the calibration is unknown.
_USUAL_SPAN_RAD = np.deg2rad(80)
_NEAR = 0.1  # quantile of the depths that stands for the near side

# Names of the classes that the detector of each modality knows.
DetectorClasses = Mapping[Modality, tuple[str, ...]]
# (M, 2) depths of the near side and of the middle of the boxes of each modality, NaN where unknown.
BoxDepths = Mapping[Modality, Float64]


@dataclass(frozen=True)
class MergedDetections:
    """M boxes of all modalities in the order of `MODALITIES`.

    Attributes:
        detections: (M) detections of all modalities.
        columns: (M,) index in `MODALITIES` of the modality of each box.
        starts: (3,) index of the first box of each modality; a box is at its start plus its row there.
    """

    detections: Detections
    columns: Int
    starts: Int

    @cached_property
    def iou(self) -> Float64:
        """(M, M) overlap of every two boxes."""
        return iou_px(self.detections.boxes_px, self.detections.boxes_px)

    @cached_property
    def is_same_class(self) -> Bool:
        """(M, M) mask of every two boxes of one class."""
        _, classes = np.unique(self.detections.types, return_inverse=True)
        return np.asarray(classes[:, None] == classes)

    def places(self, tri_boxes: Int) -> Int:
        """Return the (T, 3) indices of the boxes of (T, 3) combinations among the M, -1 where there is none."""
        return np.where(tri_boxes >= 0, tri_boxes + self.starts, -1)


@dataclass(frozen=True)
class DetectedScene:
    """Detections in one frame.

    Attributes:
        modality_detections: Detections by modality; a detector that did not run has no entry.
        size_px: (width, height) of the image.
        depths_m: Depths of the boxes by modality in metres; empty without a depth map.
        known_focal_px: Vertical focal length of the camera in pixels, or None where unknown.
        class_names: Classes that the detector of each modality knows; one without an entry knows all.
    """

    modality_detections: ModalityDetections
    size_px: tuple[int, int]
    depths_m: BoxDepths = field(default_factory=dict)
    known_focal_px: float | None = None
    class_names: DetectorClasses = field(default_factory=dict)

    @property
    def focal_px(self) -> float:
        """Focal length of the camera in pixels, or that of a usual camera."""
        usual_px = self.size_px[0] / 2 / float(np.tan(_USUAL_SPAN_RAD / 2))
        return self.known_focal_px or usual_px

    @cached_property
    def merged(self) -> MergedDetections:
        """All boxes, with the scores of their detectors."""
        parts = [
            self.modality_detections.get(modality, Detections.empty()) for modality in MODALITIES
        ]
        counts = [len(part) for part in parts]
        return MergedDetections(
            Detections(
                np.concatenate([part.boxes_px for part in parts]),
                np.concatenate([part.scores for part in parts]),
                np.concatenate([part.types for part in parts]),
            ),
            columns=np.repeat(np.arange(len(parts)), counts),
            starts=np.cumsum([0, *counts[:-1]]),
        )

    @cached_property
    def merged_depths_m(self) -> Float64:
        """(M, 2) depths of near side and middle of all boxes in metres, NaN where unknown."""
        return np.concatenate(
            [
                self.depths_m.get(
                    modality, np.full((len(self.modality_detections.get(modality, ())), 2), np.nan)
                )
                for modality in MODALITIES
            ]
        )

    def searched(self, types: NDArray[np.str_]) -> Bool:
        """Return the (T, 3) mask of the modalities whose detector ran and knows each of (T,) classes."""
        is_searched = np.zeros((len(types), len(MODALITIES)), bool)
        for column, name in enumerate(MODALITIES):
            if name in self.modality_detections:
                known = self.class_names.get(name)
                is_searched[:, column] = True if known is None else np.isin(types, known)
        return is_searched

    def without(self, *lost: Modality) -> "DetectedScene":
        """Return the scene without some modalities; without both maps, depths are unknown."""
        modality_detections = {
            name: found for name, found in self.modality_detections.items() if name not in lost
        }
        depths_m = {name: found for name, found in self.depths_m.items() if name not in lost}
        if {"dm", "rm"} <= set(lost):
            depths_m = {}
        return replace(self, modality_detections=modality_detections, depths_m=depths_m)


def scene_of(
    modality_detections: ModalityDetections,
    size_px: tuple[int, int],
    dense: DenseMaps | None = None,
    camera: Calibration | None = None,
    class_names: DetectorClasses | None = None,
) -> DetectedScene:
    """Return the detections of a frame with the depths of their boxes.

    Args:
        modality_detections: Detections by modality.
        size_px: (width, height) of the image.
        dense: Dense maps of the frame; without them, depths are unknown.
        camera: Calibration of the camera; without it, a usual camera is assumed.
        class_names: Classes that the detector of each modality knows; all where not stated.
    """
    depths_m: BoxDepths = {}
    if dense is not None and modality_detections:
        # All boxes at once: a call costs more than a box.
        boxes_px = [found.boxes_px for found in modality_detections.values()]
        every_m = box_depths_m(np.concatenate(boxes_px), dense)
        parts_m = np.split(every_m, np.cumsum([len(one) for one in boxes_px[:-1]]))
        depths_m = dict(zip(modality_detections, parts_m, strict=True))
    focal_px = None if camera is None else float(camera.image_P_cam[1, 1])
    return DetectedScene(modality_detections, size_px, depths_m, focal_px, class_names or {})


def box_depths_m(boxes_px: Float64, dense: DenseMaps) -> Float64:
    """Return the (M, 2) depths of near side and middle of (M, 4) boxes in metres, NaN where unknown.

    Depths are sampled on a grid with the same number of samples in each box, so that large boxes are as fast as
    small ones.
    """
    height, width = dense.depth_m.shape
    shares = (np.arange(_SAMPLES_PER_EDGE) + 0.5) / _SAMPLES_PER_EDGE
    corners, sizes = boxes_px[:, :2, None], (boxes_px[:, 2:] - boxes_px[:, :2])[:, :, None]
    samples = (corners + sizes * shares).astype(np.int64)
    columns = np.clip(samples[:, 0], 0, width - 1)
    rows = np.clip(samples[:, 1], 0, height - 1)
    depth_m = dense.depth_m[rows[:, :, None], columns[:, None, :]].reshape(-1, _SAMPLES_PER_EDGE**2)
    known = (depth_m > 0).sum(axis=1)
    ordered = np.sort(np.where(depth_m > 0, depth_m, np.inf), axis=1)
    ranks = (np.maximum(known - 1, 0)[:, None] * (_NEAR, 0.5)).astype(np.int64)
    found = np.take_along_axis(ordered, ranks, axis=1).astype(np.float64)
    return np.where(np.isfinite(found), found, np.nan)
