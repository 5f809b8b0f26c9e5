import numpy as np

from perception.evaluation.config import ObjectMatchConfig
from perception.evaluation.exact_obstacles import count_exactly
from perception.evaluation.objects import MotionState
from perception.geometry.grids import LocalArea
from perception.types import Frame, Obstacles, PointState, PointTruth, Result, Voxels

AREA = LocalArea()
FOUR_POINTS = ObjectMatchConfig(min_points=4)
NO_VOXELS = Voxels(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), 0.1)
ROAD, CAR, POST, SIGN, TRUNK, LEAVES = 40, 10, 80, 81, 71, 70
GROUND, STATIC, MOVING = PointState.GROUND, PointState.STATIC, PointState.MOVING
Rows = tuple[np.ndarray, int, int, bool, int]


class Level:
    def height_m(self, xy_m):
        return np.full(len(xy_m), -1.7)

    def distance_m(self, points_velo):
        return points_velo[:, 2] + 1.7


def part(x_m: float, height_m: float, kind: int, state: int, number: int = 0, moves: bool = False):
    """Return five points side by side at a height above the road, with their truth and their state."""
    points = np.zeros((5, 4), np.float32)
    points[:, 0], points[:, 1] = x_m, np.linspace(-0.1, 0.1, 5)
    points[:, 2] = height_m - 1.7
    return points, kind, number, moves, state


def count(*parts: Rows):
    road = [part(x_m, 0.0, ROAD, GROUND) for x_m in np.arange(4.0, 24.0)]
    points, kinds, numbers, moves, states = zip(*road, *parts, strict=True)
    size = len(points[0])
    frame = Frame(7, 0.0, np.concatenate(points))
    obstacles = Obstacles(np.repeat(np.array(states, np.uint8), size), NO_VOXELS, NO_VOXELS)
    truth = PointTruth(np.repeat(kinds, size), np.repeat(numbers, size), np.repeat(moves, size))
    return count_exactly(Result(frame, np.eye(4), Level(), obstacles), truth, AREA, FOUR_POINTS)


def test_every_distinct_element_above_the_ground_is_an_obstacle():
    found = count(
        part(8, 0.5, POST, STATIC),
        part(8, 1.7, SIGN, STATIC),  # on its post
        part(12, 0.5, TRUNK, STATIC),
        part(12, 1.5, LEAVES, STATIC),  # of the same tree
        part(12, 0.8, CAR, STATIC, number=3),  # under the tree
        part(16, 0.5, POST, GROUND),  # missed
        part(20, 1.9, LEAVES, STATIC),  # at the top of the area
        part(20, 0.1, CAR, STATIC, number=5),  # below the clearance
        part(40, 0.5, POST, STATIC),  # beyond the area
    )
    assert found.counts.obstacles == 4
    assert found.counts.missed_obstacles == 1
    assert found.counts.moving == found.counts.false_moving == 0
    missed = found.counted[found.is_missed]
    np.testing.assert_allclose(missed.boxes_velo.bottom_m, [[16, 0, -1.2]], atol=1e-6)
    assert found.counted.track_ids.tolist().count(2) == 1


def test_motion_is_that_of_the_points():
    found = count(
        part(8, 0.5, CAR, MOVING, number=1, moves=True),
        part(12, 0.5, CAR, STATIC, number=2, moves=True),  # missed as moving, found as obstacle
        part(16, 0.5, CAR, MOVING, number=3),  # parked, called moving
    )
    assert found.counted.motions.tolist() == [
        MotionState.STATIC,
        MotionState.MOVING,
        MotionState.MOVING,
    ]
    counts = found.counts
    assert (counts.obstacles, counts.moving) == (3, 2)
    assert (counts.missed_obstacles, counts.missed_moving) == (0, 1)
    assert (counts.false_obstacles, counts.false_moving) == (0, 1)


def test_ground_that_is_called_an_obstacle_is_false():
    found = count(part(10.5, 0.02, ROAD, STATIC), part(15.5, 0.02, ROAD, STATIC))
    assert found.counts.false_obstacles == 2
    assert found.counts.obstacles == 0
