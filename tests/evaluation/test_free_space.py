"""Cells of the grid, counted by hand."""

import numpy as np
import pytest

from perception.evaluation.free_space import FreeSpaceCounts, count_free_space
from perception.geometry.grids import LocalArea
from perception.types import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, PointTruth
from tests.obstacles.test_occupancy import post, result_of

ROAD_CLASS, CAR_CLASS = 40, 10


def test_cells_against_the_class_of_each_point():
    ground = np.array([[x + 0.5, 0.5, -2.0] for x in range(4)] + [[25.5, 0.5, -2.0]])
    # A car 1 m up in two cells, one of them with road below; a kerb of 0.1 m, a branch at 3 m, a car beyond 20 m.
    others = np.concatenate(
        [post(1.5, 0.5, 1.0), post(4.5, 0.5, 1.0), post(2.6, 0.5, 0.1), post(3.5, 0.5, 3.0), post(24.5, 0.5, 1.0)]
    )  # fmt: skip
    classes = np.repeat([ROAD_CLASS, CAR_CLASS], [len(ground), len(others)])
    truth = PointTruth(classes, np.zeros(len(classes), np.int64), np.zeros(len(classes), bool))
    states = np.array([[FREE, FREE, FREE, OCCUPIED, UNKNOWN, FREE]], np.int8)
    grid = OccupancyGrid(states, np.zeros(3), 1.0)
    counts = count_free_space(result_of(ground, others), grid, truth, LocalArea(ahead_m=30))
    # Occupied are cells 1 and 4; free are 0 and 3, as cells 1 and 2 hold something else below 2 m.
    assert counts == FreeSpaceCounts(
        occupied=2, false_free=1, free=2, true_free=1, false_occupied=1
    )
    total = counts + counts
    assert (total.false_free_share, total.false_occupied_share, total.true_free_share) == (
        0.5,
        0.5,
        0.5,
    )
    assert np.isnan(FreeSpaceCounts().false_free_share)


def test_a_synthetic_street_calls_no_obstacle_free(street):
    from data.open_drive import open_drive
    from perception.obstacles.occupancy import occupancy_grid
    from perception.pipeline import Pipeline, PipelineConfig

    drive, config = open_drive(street), PipelineConfig.for_motion()
    area = config.area_of(drive.sensor)
    counts = FreeSpaceCounts()
    with Pipeline(drive.sensor, config) as pipeline:
        for index in range(len(drive)):
            result = pipeline.step(drive.scan(index))
            grid = occupancy_grid(result)
            counts += count_free_space(result, grid, drive.point_truth(index), area)
    assert counts.occupied > 1_000
    assert counts.false_free_share <= 1e-4
    assert counts.false_occupied_share < 0.01
    assert counts.true_free_share == pytest.approx(0.85, abs=0.15)
