"""Cost of faults: named frames, unknown metrics, and curves that begin without a fault."""

from dataclasses import replace

import numpy as np

from perception.evaluation.fault_cost import CLEAN, FaultCost, FaultCostMeasure, FaultCostReport
from perception.geometry.grids import LocalArea
from perception.types import Health, HealthFinding, HealthLevel, PointTruth
from tests.known_result import known_result

DARK = Health.of([HealthFinding("camera", HealthLevel.ERROR, "camera dark", "black")])
DIM = Health.of([HealthFinding("camera", HealthLevel.WARN, "camera dark", "dim")])


def test_named_frames_are_those_of_the_fault():
    measure = FaultCostMeasure("camera-dark", 9.0, 2, "camera", LocalArea(), 0.5)
    for index, health in enumerate([Health(), DARK, Health(), DIM, DARK, DARK]):
        measure.update(replace(known_result(index), health=health), None, None)
    cost = measure.compute()
    assert cost.named == 0.75
    assert np.isnan([cost.mde_m, cost.moving_missed, cost.ap, cost.hota]).all()


def test_missed_moving_points_are_measured_over_all_frames():
    measure = FaultCostMeasure("lidar-fog", 0.1, 0, "lidar", LocalArea(), 0.5)
    # The last point alone is called moving: of road, car and car, two of which move, one is found.
    car = PointTruth(np.array([40, 10, 10]), np.array([0, 1, 2]), np.array([False, True, True]))
    walker = replace(car, is_moving=np.array([False, False, True]))
    other_scan = PointTruth(*(column[:2] for column in vars(car).values()))
    for index, truth in enumerate([car, walker, car, other_scan]):
        measure.update(known_result(index), None, truth)
    assert measure.compute().moving_missed == 2 / 5


def test_curves_begin_without_a_fault():
    def cost(kind: str, size: float, ap: float) -> FaultCost:
        return FaultCost(kind, size, 0.1, 0.2, ap, 0.5, 1.0)

    report = FaultCostReport(
        {
            CLEAN: cost(CLEAN, 0.0, 0.9),
            "lidar-fog 0.3": cost("lidar-fog", 0.3, 0.4),
            "lidar-fog 0.1": cost("lidar-fog", 0.1, 0.8),
        }
    )
    (panel,) = report.panels()
    assert panel.title == "lidar-fog"
    assert panel.curves[0].x == [0.0, 0.1, 0.3]
    assert panel.curves[0].y == [0.9, 0.8, 0.4]
    assert [curve.name for curve in panel.curves] == ["AP", "HOTA", "moving missed"]
    assert panel.curves[1].y == [0.5, 0.5, 0.5]
    assert panel.curves[2].y == [0.2, 0.2, 0.2]
    (table,) = report.tables()
    assert table.header == ["", "mDE [m]", "moving missed", "AP", "HOTA", "frames named"]
