"""What finds the point that stands for an object, and what it is shown for that."""

from dataclasses import dataclass
from typing import Protocol

from perception.tracking.single_object.near_obstacles import NearObstacles
from perception.tracking.single_object.tracker import TrackerInput
from perception.tracking.single_object.window import Window
from perception.types import Float64


@dataclass(frozen=True)
class LocalizerInput:
    """What a localizer is shown.

    Attributes:
        tracker_input: what the sensors saw.
        obstacles: the obstacles near the expected object.
        window: the box at its expected place, in the world.
        gate: where the object may be, in the world.
        elapsed_s: since the last view.
    """

    tracker_input: TrackerInput
    obstacles: NearObstacles
    window: Window
    gate: Window
    elapsed_s: float


class ObjectLocalizer(Protocol):
    """Finds the point that stands for an object."""

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Learn the object in its first box; return (3,) its place in the world, None of an empty box.

        Raises:
            PerceptionError: the view lacks what the localizer cannot do without.
        """
        ...

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Return (3,) the object's place in the world, or None where it is not found in the gate."""
        ...

    def reset(self, position_m: Float64) -> None:
        """Forget how the object moved: it is lost, and waited for at (3,) a place in the world.

        Of no concern to a localizer that keeps no motion.
        """
        del position_m
