"""Average precision of detectors and fusion under sensor corruptions of rising level."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene, scene_of
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.class_precision import ClassPrecision, PrecisionMeasure
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.fusion_measure import row_functions
from perception.evaluation.report import Column, Table
from perception.maps.projection import camera_of
from perception.render.curve_plots import Curve, CurvePanel
from perception.types import Frame, Modality

PLOT_DIFFICULTY = "moderate"
CLEAN = ("", 0.0)
# The scene of a clean frame, and of the frame under each corruption and level.
CorruptedScenes = Mapping[tuple[str, float], DetectedScene]


@dataclass(frozen=True)
class Corruption:
    """A sensor corruption.

    Attributes:
        name: Name with its unit.
        corrupt: Returns a frame at a level.
        modalities: Modalities whose input changes.
        levels: Levels, rising from above 0.
    """

    name: str
    corrupt: Callable[[Frame, float, np.random.Generator], Frame]
    modalities: tuple[Modality, ...]
    levels: tuple[float, ...]


class CorruptedDetector:
    """Detects in the clean frame and at every level of every corruption.

    Only the detectors whose input changes run again.
    """

    def __init__(
        self, detector: MultimodalDetector, corruptions: Sequence[Corruption], seed: int
    ) -> None:
        """Prepare the detectors of each corruption.

        Args:
            detector: Detectors of all modalities.
            corruptions: Corruptions with their levels.
            seed: Seed of random corruptions.
        """
        self._detector, self._seed, self._corruptions = detector, seed, corruptions
        known = detector.detectors
        self._affected = {
            one.name: MultimodalDetector({name: known[name] for name in one.modalities})
            for one in corruptions
        }

    def detect(self, frame: Frame) -> CorruptedScenes:
        """Return the detections of a frame by corruption and level.

        Raises:
            PerceptionError: the frame has no input for the detectors, or no camera.
        """
        camera, size_px = camera_of(frame)
        clean = self._detector.detect(frame)
        scenes = {CLEAN: scene_of(clean.modality_detections, size_px, clean.dense, camera)}
        for number, one in enumerate(self._corruptions):
            for level in one.levels:
                rng = np.random.default_rng((self._seed, frame.index, number))
                output = self._affected[one.name].detect(one.corrupt(frame, level, rng))
                dense = clean.dense if output.dense is None else output.dense
                found = {**clean.modality_detections, **output.modality_detections}
                scenes[one.name, level] = scene_of(found, size_px, dense, camera)
        return scenes


@dataclass(frozen=True)
class RobustnessReport:
    """Average precision by corruption, level and row.

    Attributes:
        config: Metric configuration.
        corruptions: Corruptions in the order of the tables.
        rows: Metrics of each row by corruption and level.
    """

    config: PrecisionConfig
    corruptions: Sequence[Corruption]
    rows: Mapping[tuple[str, float], Mapping[str, ClassPrecision]]

    def tables(self) -> Sequence[Table[Any]]:
        """Return a table for each corruption: a row a level, a column for each detector and fusion."""

        def column(name: str) -> Column[Mapping[str, ClassPrecision]]:
            return Column(name, lambda row: self._ap(row[name]), ".2f")

        columns = [column(name) for name in self.rows[CLEAN]]
        return [
            Table(
                f"{one.name}: AP R{self.config.recall_points[0]} [%], {PLOT_DIFFICULTY}",
                columns,
                {f"{level:g}": row for level, row in self._levels(one)},
                "level",
            )
            for one in self.corruptions
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by corruption, level and row, at every difficulty."""
        return {
            one.name: {
                f"{level:g}": {name: found.to_json(self.config) for name, found in row.items()}
                for level, row in self._levels(one)
            }
            for one in self.corruptions
        }

    def panels(self) -> list[CurvePanel]:
        """Return the average precision over the levels, a panel for each corruption, the fusion emphasised."""
        panels = []
        for one in self.corruptions:
            levels = [level for level, _ in self._levels(one)]
            curves = [
                Curve(name, levels, [self._ap(row[name]) for _, row in self._levels(one)])
                for name in self.rows[CLEAN]
            ]
            curves[-1] = replace(curves[-1], is_emphasised=True)
            label = f"AP R{self.config.recall_points[0]} [%], {PLOT_DIFFICULTY}"
            panels.append(CurvePanel("", one.name, label, curves, x_ticks=levels))
        return panels

    def _levels(self, one: Corruption) -> list[tuple[float, Mapping[str, ClassPrecision]]]:
        corrupted = [(level, self.rows[one.name, level]) for level in one.levels]
        return [(0.0, self.rows[CLEAN]), *corrupted]

    def _ap(self, precision: ClassPrecision) -> float:
        return precision.first[PLOT_DIFFICULTY].ap(self.config.recall_points[0])


@dataclass(kw_only=True)
class RobustnessMeasure(PrecisionMeasure[CorruptedScenes]):
    """Accumulates the detections under corruptions frame by frame, and measures those of the first class.

    Attributes:
        corruptions: Corruptions with their levels.
        fusion: Fusion network.
    """

    corruptions: Sequence[Corruption]
    fusion: Fusion

    def compute(self) -> RobustnessReport:
        """Return the metrics of all frames so far."""
        rows = {}
        for key in self.outputs[0]:
            scenes = [one[key] for one in self.outputs]
            rows[key] = {
                name: self.precision(DetectedBoxes.of_frames([detect(one) for one in scenes]))[0]
                for name, detect in row_functions(scenes, {"default": self.fusion}).items()
            }
        return RobustnessReport(self.config, self.corruptions, rows)
