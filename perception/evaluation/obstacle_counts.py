"""Counts of obstacles in the columns of Table 7.2, of the pipeline and as the thesis prints them."""

from dataclasses import dataclass
from typing import Annotated

from perception.evaluation.report import Metric, SummedMetrics


@dataclass(frozen=True)
class ObstacleCounts(SummedMetrics):
    """Obstacles of any number of scans, each counted once a scan; those of several sequences are added.

    Attributes:
        obstacles: Number of obstacles, moving ones included.
        moving: Number of moving obstacles.
        missed_obstacles: Number of obstacles that are not found.
        missed_moving: Number of moving obstacles that are not found to move.
        false_obstacles: Number of detected obstacles where there is none.
        false_moving: Number of detected moving obstacles where nothing moves.
    """

    obstacles: Annotated[int, Metric("obstacles")] = 0
    moving: Annotated[int, Metric("moving")] = 0
    missed_obstacles: Annotated[int, Metric("missed obstacles")] = 0
    missed_moving: Annotated[int, Metric("missed moving")] = 0
    false_obstacles: Annotated[int, Metric("false obstacles")] = 0
    false_moving: Annotated[int, Metric("false moving")] = 0


@dataclass(frozen=True)
class ObstacleSequence:
    """One row of Table 3.1.

    Attributes:
        number: Number of the row, from 1.
        sequence: Name of the sequence in KITTI's tracking benchmark.
        frames: Number of frames, all of the sequence.
        ego_status: Whether the ego vehicle is stationary, moving, or both in turn.
        scene: Scene: urban, downtown, or both.
        types: Types of the objects.
        static_objects: Number of static objects in the local area.
        moving_objects: Number of moving objects in the local area.
        printed: Counts of 25 scans by a person, as Table 7.2 prints them.
    """

    number: int
    sequence: str
    frames: int
    ego_status: str
    scene: str
    types: tuple[str, ...]
    static_objects: int
    moving_objects: int
    printed: ObstacleCounts

    @property
    def name(self) -> str:
        """Name of the row in tables."""
        return f"{self.number} ({self.sequence})"
