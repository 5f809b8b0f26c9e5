"""Joint rescoring of the boxes of all modalities, and one detection for each object (6.2.4).

The thesis' variants:

boxes of three detectors -- tri-boxes -- features -- network -- three scores for each tri-box
                         -- mean of the scores of each box -- NMS

The default:

boxes of three detectors -- matched boxes -- network -- one score and one blended box for each match -- NMS
                         -- score calibration

The default network (`train.fusion.network.NaiveBayes`) predicts how well the blended box is expected to overlap an
object of its class. It has weights and curves of their own for each set of modalities that a class was searched in, so
that a modality that is absent, from the start or from some frame on, leaves a fusion that was fitted to the others.

Each class is fused by the detectors that know it. The boxes of a class that a single detector knows, or that the network
was not trained with, keep their scores:

    rgb  Car Cyclist        cars are fused, cyclists are those of rgb
    dm   Car
    rm   Car
"""

from dataclasses import dataclass, replace
from importlib.resources.abc import Traversable

import numpy as np
from numpy.typing import NDArray

from perception.detection.config import FusionVariant, NmsConfig, TriBoxOverrides, tri_box_config
from perception.detection.fusion.detected_scene import MIN_FUSED, DetectedScene
from perception.detection.fusion.existence import existence_of
from perception.detection.fusion.features import FEATURES, tri_box_features
from perception.detection.fusion.matched_boxes import blended_boxes_px, box_weights, matched_boxes
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.detection.fusion.tri_boxes import tri_boxes
from perception.detection.onnx_model import ModelContract, ModelInput, OnnxModel, shipped_model
from perception.detection.suppression import suppress
from perception.errors import ModelError, UsageError
from perception.types import MODALITIES, Bool, Detections, Float64, FusedDetections, Int

KIND = "fusion"
CONTRACT = ModelContract(
    metadata={"kind": KIND, "modalities": ",".join(MODALITIES)},
    required_keys=("variant", "features", "hidden", "calibration", "classes"),
    inputs={"features": ModelInput(np.float32, (None, None))},
    outputs=("scores",),
)


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

    def combinations(self, scene: DetectedScene) -> Int:
        """Return the (T, 3) rows in the detections of each modality that are scored together, -1 for none."""
        if self.variant == "default":
            return matched_boxes(scene, self.tri_boxes.min_iou)
        return tri_boxes(scene, self.tri_boxes)

    def rescore(self, scene: DetectedScene) -> RescoredBoxes:
        """Return the boxes with the mean of their scores in all combinations.

        Args:
            scene: Detections of one frame, at least one box.
        """
        merged = scene.merged
        rows = self.combinations(scene)
        places = merged.places(rows)
        is_fused = self.is_fused(scene, merged.detections.types)
        tri_scores = self._tri_scores(scene, rows, is_fused[places.max(axis=1)])
        flat, count = places.ravel(), len(merged.detections)
        scores = _mean_of_boxes(flat, tri_scores.ravel(), count)
        best = _best_rows(flat, tri_scores.ravel(), count)
        detections = replace(merged.detections, scores=scores)
        return RescoredBoxes(detections, rows, best, is_fused)

    def join(self, scene: DetectedScene, rescored: RescoredBoxes) -> FusedDetections:
        """Return the boxes that suppression keeps, with the combination of each.

        The thesis' variants keep the boxes of all modalities, each with its best combination; the default one box for
        each combination, with the score of the box that counts most in it.
        """
        boxes, is_fused, columns = rescored.detections, rescored.is_fused, scene.merged.columns
        rows = rescored.tri_boxes
        if self.variant == "default":
            columns = box_weights(scene, rows).argmax(axis=1)
            main = scene.merged.places(rows)[np.arange(len(rows)), columns]
            boxes = replace(boxes[main], boxes_px=blended_boxes_px(scene, rows))
            is_fused = is_fused[main]
        else:
            rows = rows[rescored.best]
        kept = suppress(boxes, self.max_iou)
        detections, columns = boxes[kept], columns[kept]
        types, sets = detections.types, scene.set_names(detections.types)
        of_sets = np.char.add(np.char.add(sets, ":"), types.astype(np.str_))
        names = np.where(is_fused[kept], of_sets, np.array(MODALITIES)[columns])
        scores = self.calibrations.probabilities(detections.scores, names)
        # Curves differ between classes and modalities, and may change the order.
        order = np.argsort(-scores, kind="stable")
        found = replace(detections, scores=scores)[order]
        existence = existence_of(found.scores, sets[order], found.types)
        return FusedDetections(found, rows[kept[order]], columns[order], existence)

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

        A score is the expected IoU of a box with the object, or of the default variant the expected share of the
        overlap thresholds 0.3, 0.5 and 0.7 that it exceeds.
        """
        outputs = self._model({"features": features.astype(np.float32)})
        return outputs["scores"].astype(np.float64)


def is_rescored(scene: DetectedScene, types: NDArray[np.str_], variant: FusionVariant) -> Bool:
    """Return the (M,) mask of the classes that a network of the variant can rescore in a scene.

    Of a class that a single modality was searched for there is nothing that the default could rescore by.
    """
    min_modalities = MIN_FUSED if variant == "default" else 1
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
            model.name, expected="calibration of three numbers a curve", found=stated
        ) from error
