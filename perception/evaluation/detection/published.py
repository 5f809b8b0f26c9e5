"""Average precision that the thesis prints of published detectors, beside that of result files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from perception.evaluation.detection.class_precision import PrecisionReport
from perception.evaluation.detection.config import (
    PUBLISHED_CLASS,
    PUBLISHED_IOU,
    PublishedTable,
)
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.report import Table, Value, value_table

_OURS = "these results"
_RECALL_POINTS = 11  # of KITTI's benchmark at that time
# Average precision of cars in percent: easy, moderate, hard; None is missing in the printed table.
PUBLISHED_PERCENT: Mapping[PublishedTable, Mapping[str, Sequence[float | None]]] = {
    "table-7.9": {"DepthCN": (37.59, None, None), "mBoW": (36.02, None, None)},
    "table-7.11": {
        "MV3D": (90.53, 89.17, 80.16),
        "3D FCN": (85.54, 75.83, 68.30),
        "MV-RGBD-RF": (76.49, 69.92, 57.47),
        "VeloFCN": (70.68, 53.45, 46.90),
        "thesis": (64.77, 46.77, 39.38),
        "Vote3D": (56.66, 48.05, 42.64),
        "CSoR": (35.24, 26.13, 22.69),
        "mBoW": (37.63, 23.76, 18.44),
    },
}


@dataclass(frozen=True)
class PublishedComparison(PrecisionReport):
    """Average precision of several classes, and that of cars beside a table of the thesis.

    Attributes:
        published: Table of the thesis.
        data: Name of the labels on which the results were evaluated.
    """

    published: PublishedTable = "table-7.11"
    data: str = "labels"

    def tables(self) -> Sequence[Table[Any]]:
        """Return the table of all classes, and the comparison."""
        return [*super().tables(), self._comparison()]

    def to_json(self) -> dict[str, Any]:
        """Return the metrics by class, IoU and difficulty, and the comparison."""
        return {**super().to_json(), "published": self._comparison().to_json()}

    def _comparison(self) -> Table[Any]:
        rows: dict[str, dict[str, Value]] = {
            f"published: {name}": dict(zip(LEVELS, percent, strict=True))
            for name, percent in PUBLISHED_PERCENT[self.published].items()
        }
        rows[_OURS] = self._car_percent()
        notes = [
            "Published: KITTI's test set, whose labels are not public; "
            f"{_OURS}: {self.data}. Not comparable."
        ]
        title = (
            f"{self.published.replace('-', ' ').capitalize()}: average precision of {PUBLISHED_CLASS} [%], "
            f"IoU over {PUBLISHED_IOU:g}, {_RECALL_POINTS} recall points"
        )
        return replace(value_table(title, rows, ".2f", "detector"), notes=notes)

    def _car_percent(self) -> dict[str, Value]:
        (cars,) = (one for one in self.classes if one.name == PUBLISHED_CLASS)
        return {
            level: metrics.known_ap(_RECALL_POINTS)
            for level, metrics in cars.metrics[PUBLISHED_IOU].items()
        }
