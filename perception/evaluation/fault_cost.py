"""What faults of sensors cost: ground, moving points, detections and tracks of a drive, over the size of each fault."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from perception.evaluation.detection.class_precision import PrecisionMeasure
from perception.evaluation.detection.config import PrecisionConfig
from perception.evaluation.detection.protocol import kitti_class
from perception.evaluation.ground import ground_errors
from perception.evaluation.obstacles import motion_confusions
from perception.evaluation.report import CONTEXT, Metric, Metrics, Report, Table
from perception.evaluation.vehicle_measure import VehicleMeasure
from perception.geometry.grids import LocalArea
from perception.render.curve_plots import Curve, CurvePanel
from perception.types import Detections, Labels, PointTruth, Result

CLEAN = "none"
PROTOCOL = {
    "fault": "from the first third of the drive to its end, one fault a run; all frames are measured",
    "mDE": "mean distance of the bottom centres of labelled boxes from the estimated ground, all frames together",
    "moving missed": "share of the points of moving objects that are not called moving, where every point has truth",
    "AP": "average precision of the fused cars in the image, KITTI's moderate, IoU over 0.7, R40",
    "HOTA": "of the fused cars in the image, by KITTI's rules",
}
_RECALL_POINTS = 40


@dataclass(frozen=True)
class FaultCost(Metrics):
    """Metrics of one run.

    Attributes:
        kind: Kind of fault.
        size: Its size.
        mde_m: Mean error of the ground in metres.
        moving_missed: Share of the moving points that are missed, 0 to 1.
        ap: Average precision of cars, 0 to 1.
        hota: HOTA of cars, 0 to 1.
        named: Share of the frames of the fault in which the health of the sensor is not OK.
    """

    kind: Annotated[str, CONTEXT]
    size: Annotated[float, CONTEXT]
    mde_m: Annotated[float, Metric("mDE [m]", ".4f")]
    moving_missed: Annotated[float, Metric("moving missed", ".3f")]
    ap: Annotated[float, Metric("AP", ".3f")]
    hota: Annotated[float, Metric("HOTA", ".3f")]
    named: Annotated[float, Metric("frames named", ".2f")]


@dataclass(frozen=True)
class FaultCostReport(Report):
    """Cost of all faults.

    Attributes:
        costs: Metrics by the name of the run; the first is without fault.
    """

    costs: Mapping[str, FaultCost]

    def tables(self) -> Sequence[Table[Any]]:
        """Return one table, a row a run."""
        return [Table("cost of faults", FaultCost.columns(), self.costs)]

    def panels(self) -> list[CurvePanel]:
        """Return AP and HOTA over the size of each fault; at 0 there is none."""
        clean = self.costs[CLEAN]
        by_kind: dict[str, list[FaultCost]] = {}
        for one in self.costs.values():
            if one is not clean:
                by_kind.setdefault(one.kind, []).append(one)
        panels = []
        for kind, costs in by_kind.items():
            rising = sorted([*costs, clean], key=lambda one: one.size)
            x = [one.size for one in rising]
            curves = [
                Curve("AP", x, [one.ap for one in rising]),
                Curve("HOTA", x, [one.hota for one in rising]),
                Curve("moving missed", x, [one.moving_missed for one in rising]),
            ]
            panels.append(CurvePanel(kind, "size", "share", curves, y_limits=(0.0, 1.0)))
        return panels


@dataclass
class FaultCostMeasure:
    """Measures one run with a fault.

    Attributes:
        kind: Kind of fault.
        size: Its size.
        first: Index of its first frame.
        part: Sensor that fails.
        area: Area in which the ground is measured.
        display_score: Score from which a vehicle counts.
    """

    kind: str
    size: float
    first: int
    part: str
    area: LocalArea
    display_score: float
    _errors_m: list[float] = field(default_factory=list, init=False)
    _found: int = field(default=0, init=False)
    _missed: int = field(default=0, init=False)
    _named: list[bool] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        """Start without a frame."""
        self._vehicles = VehicleMeasure(self.display_score)
        self._precision: PrecisionMeasure[Detections] = PrecisionMeasure(
            [kitti_class("Car")], PrecisionConfig()
        )

    def update(self, result: Result, labels: Labels | None, truth: PointTruth | None) -> None:
        """Add one frame."""
        frame = result.frame
        if frame.index >= self.first:
            self._named.append(result.health.level_of(self.part) > 0)
        if labels is not None:
            errors = ground_errors(
                frame.index, result.ground, labels.boxes_velo.bottom_m, self.area
            )
            self._errors_m += np.abs(errors.errors_m).tolist()
            if result.vehicles is not None:
                self._vehicles.update(result, labels)
                self._precision.update(result.vehicles.fused.detections, labels)
        if truth is not None and len(truth.classes) == len(frame.points_velo):
            states = result.obstacles.point_states
            moving = motion_confusions(states, truth.classes, truth.is_moving)["moving"]
            self._found += moving.true_positives
            self._missed += moving.false_negatives

    def compute(self) -> FaultCost:
        """Return the metrics; NaN for what the drive has no truth of."""
        ap = hota = float("nan")
        if self._precision.outputs:
            detected = self._precision.detected(lambda one: one)
            (cars,) = self._precision.precision(detected)
            ap = float(cars.first["moderate"].ap(_RECALL_POINTS))
        if not np.isnan(ap):  # without a car there is nothing to track
            hota = float(np.mean(self._vehicles.compute().tracking["car"].hota.hota))
        moving = self._found + self._missed
        return FaultCost(
            self.kind,
            self.size,
            mde_m=float(np.mean(self._errors_m)) if self._errors_m else float("nan"),
            moving_missed=self._missed / moving if moving else float("nan"),
            ap=ap,
            hota=hota,
            named=float(np.mean(self._named)) if self._named else float("nan"),
        )
