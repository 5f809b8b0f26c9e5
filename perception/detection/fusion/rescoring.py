"""Joint rescoring of the boxes of all modalities, and one detection for each object (6.2.4).

boxes of three detectors -- tri-boxes -- features -- network -- three scores for each tri-box
                         -- mean of the scores of each box -- NMS -- score calibration

The default network predicts how well each box is expected to overlap an object of its class, by which boxes are
ranked. The boxes of an object are blended by the scores of their detectors, which say more of where a box ends.

Each class is fused by the detectors that know it. The boxes of a class that a single detector knows, or that the network
was not trained with, keep their scores:

    rgb  Car Cyclist        cars are fused, cyclists are those of rgb
    dm   Car
    rm   Car
"""

from dataclasses import dataclass, replace
from importlib.abc import Traversable

import numpy as np
from numpy.typing import NDArray

from perception.detection.config import FusionVariant, NmsConfig, TriBoxOverrides, tri_box_config
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.features import FEATURES, tri_box_features
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.detection.onnx_model import ModelContract, ModelInput, OnnxModel, shipped_model
from perception.detection.suppression import suppress
from perception.errors import ModelError, UsageError
from perception.geometry.box_overlap_px import paired_iou_px
from perception.types import (
    MODALITIES,
    Bool,
    Detections,
    Float64,
    FusedDetections,
    Int,
)

KIND = "fusion"
CONTRACT = ModelContract(
    metadata={"kind": KIND, "modalities": ",".join(MODALITIES)},
    required_keys=("variant", "features", "hidden", "calibration", "classes"),
    inputs={"features": ModelInput(np.float32, (None, None))},
    outputs=("scores",),
)
_MIN_ERROR = 0.02  # smallest error of a box; labels are no better


@dataclass(frozen=True)
class RescoredBoxes:
    """M boxes of all modalities with their new scores, and the T combinations behind these.

    Attributes:
        detections: (M) boxes in the order of `DetectedScene.merged`.
        tri_boxes: (T, 3) rows of the combined boxes in the detections of each modality, -1 for none.
        best: (M,) combination with the highest score of each box.
        is_fused: (M,) mask of the boxes that the network has rescored.
    """

    detections: Detections
    tri_boxes: Int
    best: Int
    is_fused: Bool


_NO_OVERRIDES = TriBoxOverrides()


class Fusion:
    """Fusion network: rescores the detections of up to three modalities and joins them; a `DetectionFusion`."""

    def __init__(
        self,
        model: Traversable | FusionVariant = "default",
        *,
        max_iou: float = NmsConfig.max_iou,
        tri_boxes: TriBoxOverrides = _NO_OVERRIDES,
    ) -> None:
        """Open the network.

        Args:
            model: Model file, or the variant of a model of this package.
            max_iou: Overlap (IoU) above which two boxes show the same object.
            tri_boxes: Combinations of boxes in place of those that the variant was trained with.

        Raises:
            ModelError: the file does not hold a fusion network.
        """
        file = shipped_model(f"{KIND}_{model}") if isinstance(model, str) else model
        # One thread: the network is faster than waking a second one.
        self._model = OnnxModel(file, CONTRACT, threads=1)
        self.name = self._model.name
        """Name of the model file."""
        self.metadata = self._model.metadata
        """Metadata of the model file."""
        self.variant: FusionVariant = _variant(self._model)
        """Features of a combination that the network takes."""
        self.class_names = tuple(self.metadata["classes"].split(","))
        """Classes of its training."""
        self.max_iou = max_iou
        """Overlap (IoU) above which two boxes show the same object."""
        self.tri_boxes = tri_boxes.over(
            tri_box_config(self.variant, _max_partners(self.metadata.get("max_partners")))
        )
        """Combinations of boxes."""
        self.calibrations = _calibrations(self._model)
        """Calibration from scores to probabilities."""

    def fuse(self, scene: DetectedScene) -> FusedDetections:
        """Return the fused detections, best first; any modality may be missing."""
        if not len(scene.merged.detections):
            return FusedDetections.empty()
        return self.join(scene, self.rescore(scene))

    def rescore(self, scene: DetectedScene) -> RescoredBoxes:
        """Return the boxes with the mean of their scores in all combinations.

        Args:
            scene: Detections of one frame, at least one box.
        """
        merged = scene.merged
        rows = tri_boxes(scene, self.tri_boxes)
        places = merged.places(rows)
        is_fused = self.is_fused(scene, merged.detections.types)
        tri_scores = self._tri_scores(scene, rows, is_fused[places.max(axis=1)])
        flat, count = places.ravel(), len(merged.detections)
        scores = _mean_of_boxes(flat, tri_scores.ravel(), count)
        best = _best_rows(flat, tri_scores.ravel(), count)
        detections = replace(merged.detections, scores=scores)
        return RescoredBoxes(detections, rows, best, is_fused)

    def join(self, scene: DetectedScene, rescored: RescoredBoxes) -> FusedDetections:
        """Return the boxes that suppression keeps, with the combination of each."""
        kept = suppress(rescored.detections, self.max_iou)
        rows = rescored.best[kept]
        source_indices = rescored.tri_boxes[rows]
        detections = rescored.detections[kept]
        boxes_px = detections.boxes_px
        if self.variant == "default":
            places = scene.merged.places(source_indices)
            others = scene.merged.detections
            others_px = others.boxes_px[places]
            is_own, is_present = places == kept[:, None], places >= 0
            is_same = is_own | (is_present & (_overlaps(others_px, is_own) > self.max_iou))
            boxes_px = _weighted_mean(others_px, is_same, others.scores[places])
        columns = scene.merged.columns[kept]
        own_columns = np.where(rescored.is_fused[kept], -1, columns)
        scores = self.calibrations.probabilities(detections.scores, own_columns)
        found = Detections(boxes_px, scores, detections.types)
        return FusedDetections(found, source_indices, columns, existence=scores)

    def is_fused(self, scene: DetectedScene, types: NDArray[np.str_]) -> Bool:
        """Return the (M,) mask of the classes that the network rescores in a scene."""
        is_known = np.isin(types, self.class_names)
        return is_known & is_rescored(scene, types, self.variant)

    def _tri_scores(self, scene: DetectedScene, rows: Int, is_fused: Bool) -> Float64:
        """Return the (T, 3) scores of (T, 3) combinations, of which the (T,) marked ones are fused."""
        scores = np.append(scene.merged.detections.scores, 0.0)[scene.merged.places(rows)]
        if is_fused.any():
            scores[is_fused] = self.predict(tri_box_features(scene, rows[is_fused], self.variant))
        return scores

    def predict(self, features: Float64) -> Float64:
        """Return the (T, 3) scores of combinations by their (T, F) features, undefined where there is no box.

        A score is the expected IoU of a box with the object, or of the default variant the expected share of
        KITTI's overlap thresholds that it exceeds.
        """
        outputs = self._model({"features": features.astype(np.float32)})
        return outputs["scores"].astype(np.float64)


def is_rescored(scene: DetectedScene, types: NDArray[np.str_], variant: FusionVariant) -> Bool:
    """Return the (M,) mask of the classes that a network of the variant can rescore in a scene.

    Of a class that a single modality was searched for there is nothing that the default could rescore by.
    """
    min_modalities = 2 if variant == "default" else 1
    return np.asarray(scene.searched(types).sum(axis=1) >= min_modalities)


def _mean_of_boxes(places: Int, values: Float64, count: int) -> Float64:
    """Return the (M,) mean of the values of each box in its combinations; arguments as of `_best_rows`."""
    is_observed = places >= 0
    sums = np.bincount(places[is_observed], values[is_observed], count)
    return np.asarray(sums / np.bincount(places[is_observed], minlength=count))


def _best_rows(places: Int, scores: Float64, count: int) -> Int:
    """Return the (M,) row of the combination with the highest score of each box, the first of equals.

    Args:
        places: (3T,) index of each box of the combinations among the M, -1 where there is none.
        scores: (3T,) score of each box of the combinations.
        count: Number of boxes, M, each of which is in a combination.
    """
    peaks = np.full(count + 1, -np.inf)  # the last entry is of missing boxes
    np.maximum.at(peaks, places, scores)
    at_peak = np.flatnonzero(scores == peaks[places])
    best = np.empty(count + 1, np.int64)
    best[places[at_peak[::-1]]] = at_peak[::-1] // len(MODALITIES)  # the last assignment stays
    return best[:count]


def _overlaps(boxes_px: Float64, is_own: Bool) -> Float64:
    """Return the (M, 3) overlaps (IoU) of the (M, 3, 4) boxes of a combination with the one marked in (M, 3)."""
    own_px = np.repeat(boxes_px[is_own], len(MODALITIES), axis=0)
    return paired_iou_px(own_px, boxes_px.reshape(-1, 4)).reshape(is_own.shape)


def _weighted_mean(boxes_px: Float64, is_same: Bool, scores: Float64) -> Float64:
    """Return the (M, 4) means of those of (M, 3, 4) boxes that show the same object.

    Errors of boxes are taken as independent between modalities and proportional to 1 - score: weights are its inverse
    square.

    Args:
        boxes_px: (M, 3, 4) boxes of each combination.
        is_same: (M, 3) mask of the boxes that count.
        scores: (M, 3) score of each box.
    """
    weights = np.where(is_same, np.maximum(1 - scores, _MIN_ERROR) ** -2, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray((weights[..., None] * boxes_px).sum(axis=1))


def _variant(model: OnnxModel) -> FusionVariant:
    """Return the variant of the file's features; a ModelError where its features are not known."""
    stated, input_count = model.metadata["variant"], model.inputs["features"].shape[1]
    for variant, names in FEATURES.items():
        if (
            variant == stated
            and ",".join(names) == model.metadata["features"]
            and input_count == len(names)
        ):
            return variant
    raise ModelError(
        model.name,
        expected=f"a variant {', '.join(FEATURES)} with its features in their order",
        found=f"{stated} with {input_count} inputs",
        advice="retrain it with `trifuse train fusion`",
    )


def _max_partners(stated: str | None) -> int | None:
    """Return the number of partners that a file states, None where it is that of its variant."""
    return int(stated) if stated is not None and stated.isdigit() else None


def _calibrations(model: OnnxModel) -> FusionCalibration:
    stated = model.metadata["calibration"]
    try:
        return FusionCalibration.parse(stated)
    except (ValueError, UsageError) as error:
        raise ModelError(
            model.name,
            expected="calibration of three numbers a curve",
            found=stated,
        ) from error
