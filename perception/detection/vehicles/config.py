"""Configuration of the vehicles stage: detections are located in the scan and tracked."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from perception.tracking.vehicles.config import VehicleTrackerConfig


@dataclass(frozen=True)
class VehiclePointsConfig:
    """Segmentation of a vehicle's points within its 2D box.

    Attributes:
        max_depth_m: Maximum depth of a point along the optical axis.
        border_extension: Extension of a box that the image's border cuts, in heights of the box; the LiDAR
            sees the vehicle there too.
        ground_cell_m: Edge of the cells of the lowest points.
        ground_search_radius_m: Radius within which the lowest point is ground; beside a car some ground is observed.
        clearance_m: Minimum height above the ground of a vehicle's points.
        max_height_m: Maximum height above the ground, of lorries and buses.
        model_error_m: Maximum difference between the lowest point and a ground model that is used.
        model_reach_m: Maximum distance from the LiDAR at which the ground model is used.
        car_height_m: Height of a common car.
        near_deviation: Standard deviation of the logarithm of depth, relative to the depth at which a common car
            has the height of the box, towards the camera: small cars, and boxes drawn too high.
        far_deviation: Standard deviation of the same away from the camera: vans and lorries.
        cut_deviation: Standard deviation of the same towards the camera where the image's border cuts the box.
        center_deviation: Standard deviation of the points from the middle of the box, where its sides are at 1.
        cluster_gap_m: Maximum gap between two points of one vehicle in top view, near the sensor.
        cluster_gap_per_m: Increase of that gap with distance, as beams spread.
        max_samples: Maximum number of points of a box that vote.
    """

    max_depth_m: float = 100.0
    border_extension: float = 3.0
    ground_cell_m: float = 0.5
    ground_search_radius_m: float = 1.5
    clearance_m: float = 0.2
    max_height_m: float = 3.5
    model_error_m: float = 0.3
    model_reach_m: float = 30.0
    car_height_m: float = 1.5
    near_deviation: float = 0.25
    far_deviation: float = 0.5
    cut_deviation: float = 1.0
    center_deviation: float = 0.5
    cluster_gap_m: float = 0.4
    cluster_gap_per_m: float = 0.012
    max_samples: int = 256


@dataclass(frozen=True)
class LShapeFitConfig:
    """Fit of a rectangle to the one or two observed sides of a vehicle.

    Attributes:
        min_points: Minimum number of points of a vehicle that gets a box.
        samples: Number of points of each vehicle that are used.
        trim_share: Share of these that is left out at either end.
        directions: Number of directions within a quarter turn.
        fine_directions: Number of directions around the best one.
        kept_directions: Number of directions for which sizes and positions are tried.
        side_deviation_m: Standard deviation of points from the side they lie on.
        max_side_distance_m: Distance from a side beyond which a point costs no more, as on roofs and seats.
        side_weight: Number of independent observations that all points together are worth.
        lengths_m: Lengths that are tried.
        length_m: Mean and standard deviation of the lengths of common cars.
        width_m: Mean and standard deviation of the widths of common cars.
        min_height_m: Minimum height of a box, that of a common car.
        edge_deviation_px: Standard deviation of the sides of the 2D box.
        edge_deviation_share: Increase of the same, as a share of the box's width.
        hidden_side_cost: Cost of a box whose side towards the sensor is not observed.
        centered_cost: Cost of a box that extends beyond both ends of the points.
    """

    min_points: int = 3
    samples: int = 64
    trim_share: float = 0.02
    directions: int = 18
    fine_directions: int = 7
    kept_directions: int = 4
    side_deviation_m: float = 0.15
    max_side_distance_m: float = 0.4
    side_weight: float = 12.0
    lengths_m: tuple[float, ...] = (3.5, 4.0, 4.5)
    length_m: tuple[float, float] = (4.0, 0.5)
    width_m: tuple[float, float] = (1.65, 0.15)
    min_height_m: float = 1.5
    edge_deviation_px: float = 2.0
    edge_deviation_share: float = 0.07
    hidden_side_cost: float = 4.0
    centered_cost: float = 2.0

    def for_class(self, name: str) -> Self:
        """Return the configuration of a class: with its sizes where it is known not to be as large as a car."""
        size = CLASS_SIZES.get(name.lower())
        if size is None:
            return self
        mean_m, deviation_m = size.length_m
        return replace(
            self,
            lengths_m=(mean_m - deviation_m, mean_m, mean_m + deviation_m),
            length_m=size.length_m,
            width_m=size.width_m,
            min_height_m=size.height_m,
        )


@dataclass(frozen=True)
class ClassSize:
    """Size of the objects of a class.

    Attributes:
        length_m: Mean and standard deviation of the lengths.
        width_m: Mean and standard deviation of the widths.
        height_m: Height of which the LiDAR may miss the top.
    """

    length_m: tuple[float, float]
    width_m: tuple[float, float]
    height_m: float


# Sizes of KITTI's classes other than Car, rounded from the statistics of its labels.
CLASS_SIZES: Mapping[str, ClassSize] = {
    "pedestrian": ClassSize((0.85, 0.2), (0.65, 0.15), 1.6),
    "person_sitting": ClassSize((0.8, 0.2), (0.6, 0.15), 1.2),
    "cyclist": ClassSize((1.75, 0.2), (0.6, 0.15), 1.6),
    "van": ClassSize((5.0, 0.7), (1.9, 0.2), 1.9),
    "truck": ClassSize((10.0, 3.0), (2.6, 0.3), 2.8),
    "tram": ClassSize((16.0, 5.0), (2.5, 0.3), 3.3),
}


@dataclass(frozen=True)
class VehicleConfig:
    """Vehicles stage: points, distance and box of each detection, and its track.

    Attributes:
        points: Segmentation of a vehicle's points.
        fit: Fit of a vehicle's box.
        tracker: Tracker of vehicles; its `low_score` is that of the detections that are located.
    """

    points: VehiclePointsConfig = field(default_factory=VehiclePointsConfig)
    fit: LShapeFitConfig = field(default_factory=LShapeFitConfig)
    tracker: VehicleTrackerConfig = field(default_factory=VehicleTrackerConfig)
