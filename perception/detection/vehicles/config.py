"""Configuration of the vehicles stage: detections are located in the scan and tracked."""

from dataclasses import dataclass, field
from typing import Literal

from perception.tracking.vehicles.config import VehicleTrackerConfig


@dataclass(frozen=True)
class VehicleConfig:
    """Vehicles stage: points, distance and box of each detection, and its track.

    Attributes:
        max_depth_m: Maximum depth of a point along the optical axis.
        min_points: Minimum number of points of an object that gets a box.
        traffic_side: Side of the road that vehicles keep to, before shapes and motion tell: beyond the own lane on the
            other side, they are taken to come towards the sensor.
        lane_width_m: Width of the own lane.
        min_existence: Minimum existence of a detection that is located. A lower one than the tracker's, since a box
            that fits too badly to count may still hold returns that are not another object's.
        tracker: Tracker of vehicles.
    """

    max_depth_m: float = 100.0
    min_points: int = 3
    traffic_side: Literal["right", "left"] = "right"
    lane_width_m: float = 3.5
    min_existence: float = 0.05
    tracker: VehicleTrackerConfig = field(default_factory=VehicleTrackerConfig)
