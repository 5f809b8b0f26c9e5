"""Average precision of detectors and fusion under sensor corruptions of rising level."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.fusion.detected_scene import DetectedScene
from perception.detection.fusion.rescoring import Fusion
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.evaluation.detection.class_precision import ClassPrecision, PrecisionMeasure
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.fusion_measure import row_functions
from perception.evaluation.report import Report, Table, value_table
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


def corrupted_detector(
    detector: MultimodalDetector, corruptions: Sequence[Corruption], seed: int
) -> Callable[[Frame], CorruptedScenes]:
    """Return what detects in a clean frame and in the frame at every level of every corruption.

    Only the detectors whose input changes run again.

    Args:
        detector: Detectors of all modalities.
        corruptions: Corruptions with their levels.
        seed: Seed of random corruptions.
    """
    affected = [
        MultimodalDetector({name: detector.detectors[name] for name in one.modalities})
        for one in corruptions
    ]

    def detect(frame: Frame) -> CorruptedScenes:
        clean = detector.detect(frame)
        scenes = {CLEAN: clean.scene}
        for number, one in enumerate(corruptions):
            for level in one.levels:
                rng = np.random.default_rng((seed, frame.index, number))
                output = affected[number].detect(one.corrupt(frame, level, rng))
                found = {
                    **clean.scene.modality_detections,
                    **output.scene.modality_detections,
                }
                scenes[one.name, level] = replace(clean.scene, modality_detections=found)
        return scenes

    return detect


@dataclass(frozen=True)
class RobustnessReport(Report):
    """Average precision by corruption, level and detector.

    Attributes:
        config: Metric configuration.
        rows: Metrics of each detector and fusion by corruption and level, 0 for clean frames.
    """

    config: PrecisionConfig
    rows: Mapping[str, Mapping[float, Mapping[str, ClassPrecision]]]

    def tables(self) -> Sequence[Table[Any]]:
        """Return a table for each corruption: a row for each level, a column for each detector and fusion."""
        return [
            value_table(
                f"{corruption}: {self._label}",
                {f"{x:g}": {n: self._ap(p) for n, p in row.items()} for x, row in levels.items()},
                ".2f",
                "level",
            )
            for corruption, levels in self.rows.items()
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by corruption, level and detector, at every difficulty."""
        return {
            corruption: {
                f"{level:g}": {name: found.to_json() for name, found in row.items()}
                for level, row in levels.items()
            }
            for corruption, levels in self.rows.items()
        }

    def panels(self) -> list[CurvePanel]:
        """Return the average precision over the levels, a panel for each corruption, the fusion emphasised."""
        panels = []
        for corruption, levels in self.rows.items():
            x = list(levels)
            curves = [
                Curve(name, x, [self._ap(row[name]) for row in levels.values()])
                for name in levels[0.0]
            ]
            curves[-1] = replace(curves[-1], is_emphasised=True)
            panels.append(CurvePanel("", corruption, self._label, curves, x_ticks=x))
        return panels

    @property
    def _label(self) -> str:
        return f"AP R{self.config.recall_points[0]} [%], {PLOT_DIFFICULTY}"

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
        clean, rows = self._row(CLEAN), {}
        for one in self.corruptions:
            corrupted = {level: self._row((one.name, level)) for level in one.levels}
            rows[one.name] = {0.0: clean, **corrupted}
        return RobustnessReport(self.config, rows)

    def _row(self, key: tuple[str, float]) -> dict[str, ClassPrecision]:
        scenes = [one[key] for one in self.outputs]
        return {
            name: self.precision(DetectedBoxes.of_frames([detect(one) for one in scenes]))[0]
            for name, detect in row_functions(scenes, {"default": self.fusion}).items()
        }
