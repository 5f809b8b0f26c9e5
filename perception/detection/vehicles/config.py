"""Configuration of the vehicles stage: detections are located in the scan and tracked."""

from dataclasses import dataclass, field
from typing import Literal

from perception.tracking.vehicles.config import VehicleTrackerConfig


@dataclass(frozen=True)
class VehiclePointsConfig:
    """Segmentation of a vehicle's points within its 2D box.

    Attributes:
        max_depth_m: Maximum depth of a point along the optical axis.
        border_extension: Extension of a box that the image's border cuts, in heights of the box; the LiDAR
            sees the vehicle there too.
        ground_cell_m: Edge of the cells of the lowest points.
        ground_search_radius_m: Distance within which some ground is observed, beside a car.
        ground_step_m: Maximum height of ground above the lowest point within that distance.
        clearance_m: Minimum height above the ground of a vehicle's points.
        max_height_deviations: Maximum height above the ground, in standard deviations above the mean of the class.
        model_error_m: Maximum difference between the ground around and a ground model that is used.
        model_reach_m: Maximum distance from the LiDAR at which the ground model is used.
        near_deviation: Standard deviation of the logarithm of depth, relative to the depth at which an object of the
            class has the height of the box, towards the camera: small objects, and boxes drawn too high.
        far_deviation: Standard deviation of the same away from the camera: large objects, and those of another class.
        cut_deviation: Standard deviation of the same towards the camera where the image's border cuts the box.
        center_deviation: Standard deviation of the points from the middle of the box, where its sides are at 1.
        cluster_gap_widths: Maximum gap between two points of one object in top view, near the sensor, in widths of the
            class.
        cluster_gap_per_m: Increase of that gap with distance, as beams spread.
        max_samples: Maximum number of points of a box that vote.
        same_place_iou: Minimum overlap in the image of two detections that share their returns.
    """

    max_depth_m: float = 100.0
    border_extension: float = 3.0
    ground_cell_m: float = 0.5
    ground_search_radius_m: float = 1.5
    ground_step_m: float = 0.2
    clearance_m: float = 0.2
    max_height_deviations: float = 4.0
    model_error_m: float = 0.3
    model_reach_m: float = 30.0
    near_deviation: float = 0.2
    far_deviation: float = 0.5
    cut_deviation: float = 1.0
    center_deviation: float = 0.5
    cluster_gap_widths: float = 0.25
    cluster_gap_per_m: float = 0.012
    max_samples: int = 256
    same_place_iou: float = 0.6


@dataclass(frozen=True)
class LShapeFitConfig:
    """Fit of a rectangle to the one or two observed sides of a vehicle.

    Attributes:
        trim_share: Share of these that is left out at either end.
        directions: Number of directions within a quarter turn.
        fine_directions: Number of directions around the best one.
        kept_directions: Number of directions for which sizes and positions are tried.
        side_deviation_m: Standard deviation of points from the side they lie on.
        max_side_distance_m: Distance from a side beyond which a point costs no more, as on roofs and seats.
        side_weight: Number of independent observations that all points together are worth.
        length_steps: Lengths that are tried, in standard deviations from the mean of the class.
        edge_deviation_px: Standard deviation of the sides of the 2D box.
        edge_deviation_share: Increase of the same, as a share of the box's width.
        hidden_side_cost: Cost of a box whose side towards the sensor is not observed.
        centered_cost: Cost of a box that extends beyond both ends of the points.
    """

    trim_share: float = 0.02
    directions: int = 18
    fine_directions: int = 7
    kept_directions: int = 4
    side_deviation_m: float = 0.15
    max_side_distance_m: float = 0.4
    side_weight: float = 12.0
    length_steps: tuple[float, ...] = (-1.0, 0.0, 1.0)
    edge_deviation_px: float = 2.0
    edge_deviation_share: float = 0.07
    hidden_side_cost: float = 4.0
    centered_cost: float = 2.0


@dataclass(frozen=True)
class BoxHeightConfig:
    """Height of a box, from the 2D box and the class; points may be higher.

    Attributes:
        top_deviation_px: Standard deviation of the upper side of the 2D box.
        top_deviation_share: Increase of the same, as a share of the box's height.
        max_deviations: Maximum difference from the height of the class that is trusted, in its standard deviations.
        min_vehicle_deviation_m: Minimum standard deviation of the height of a vehicle, whose class may be another.
    """

    top_deviation_px: float = 1.0
    top_deviation_share: float = 0.05
    max_deviations: float = 2.5
    min_vehicle_deviation_m: float = 0.3


@dataclass(frozen=True)
class BodyFitConfig:
    """Fit of a rectangle to the returns of a person, on foot or on a cycle.

    Attributes:
        hidden_depth_m: Distance of the middle behind the median of the returns.
        directions: Number of directions within half a turn.
        spread_share: Standard deviation of returns along length and width, as a share of these.
        max_deviations: Number of standard deviations beyond which a point costs no more.
        weight: Number of independent observations that all returns together are worth.
        road_deviation_rad: Standard deviation of headings from the vehicle's.
    """

    hidden_depth_m: float = 0.1
    directions: int = 18
    spread_share: float = 0.25
    max_deviations: float = 3.0
    weight: float = 6.0
    road_deviation_rad: float = 0.6


@dataclass(frozen=True)
class CameraJoiningConfig:
    """When detections in two cameras are one object.

    Attributes:
        min_shared: Minimum share of the returns of the one that has fewer which both have.
        min_iou: Minimum IoU of both boxes on the ground, unless they share returns.
        min_iou_px: Minimum IoU in one image where one of them has no box on the ground: the other is moved there at
            its distance.
        assumed_height_m: Height of an object without returns, by whose height in the image it is moved.
    """

    min_shared: float = 0.5
    min_iou: float = 0.2
    min_iou_px: float = 0.4
    assumed_height_m: float = 1.6


@dataclass(frozen=True)
class VehicleConfig:
    """Vehicles stage: points, distance and box of each detection, and its track.

    Attributes:
        points: Segmentation of a vehicle's points.
        height: Height of a box.
        fit: Fit of the box of what has sides.
        body_fit: Fit of the box of people.
        min_points: Minimum number of points of an object that gets a box.
        samples: Number of points of each object that its box is fitted to.
        traffic_side: Side of the road that vehicles keep to. Which end of a box is its front is not seen: beyond the
            own lane on the other side, vehicles are taken to come towards the sensor, until they move.
        lane_width_m: Width of the own lane.
        min_existence: Minimum existence of a detection that is located. A lower one than the tracker's, since a box
            that fits too badly to count may still hold returns that are not another object's.
        class_height_deviation_m: Standard deviation of the height in one scan, which tells classes of vehicles apart.
        class_score_weight: Weight of the logarithm of scores beside that of the likelihood of a height.
        joining: Joining of the detections of several cameras.
        tracker: Tracker of vehicles.
    """

    points: VehiclePointsConfig = field(default_factory=VehiclePointsConfig)
    height: BoxHeightConfig = field(default_factory=BoxHeightConfig)
    fit: LShapeFitConfig = field(default_factory=LShapeFitConfig)
    body_fit: BodyFitConfig = field(default_factory=BodyFitConfig)
    min_points: int = 3
    samples: int = 64
    traffic_side: Literal["right", "left"] = "right"
    lane_width_m: float = 3.5
    min_existence: float = 0.05
    class_height_deviation_m: float = 0.1
    class_score_weight: float = 0.5
    joining: CameraJoiningConfig = field(default_factory=CameraJoiningConfig)
    tracker: VehicleTrackerConfig = field(default_factory=VehicleTrackerConfig)
