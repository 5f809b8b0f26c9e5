"""Classes and limits of nuScenes' detection task, in its configuration detection_cvpr_2019.

H. Caesar et al., "nuScenes: a multimodal dataset for autonomous driving", CVPR 2020.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Protocol = Literal["kitti", "nuscenes"]

# True-positive errors as the task names them, in the order of its score.
ERRORS = ("trans_err", "scale_err", "orient_err", "vel_err", "attr_err")
DISTANCES_M = (0.5, 1.0, 2.0, 4.0)  # of centres over the ground, below which boxes match
ERROR_DISTANCE_M = 2.0
MIN_RECALL = MIN_PRECISION = 0.1
RECALL_STEPS = 100  # a curve has a point at each of 0, 1/100 .. 1
MEAN_AP_WEIGHT = 5
MAX_BOXES = 500  # of the results of a sample
MAX_GAP_S = 1.5  # between two labels from which a velocity follows, to either side


@dataclass(frozen=True)
class TaskClass:
    """Class of the detection task.

    Attributes:
        max_distance_m: Distance from the vehicle over the ground below which objects and detections count.
        errors: Errors that are measured.
        heading_period_rad: Angle after which a heading is the same.
        attributes: Attributes of an object.
    """

    max_distance_m: float
    errors: tuple[str, ...] = ERRORS
    heading_period_rad: float = 2 * np.pi
    attributes: tuple[str, ...] = field(default=(), kw_only=True)


_VEHICLE = ("vehicle.moving", "vehicle.parked", "vehicle.stopped")
_CYCLE = ("cycle.with_rider", "cycle.without_rider")
_PERSON = ("pedestrian.moving", "pedestrian.sitting_lying_down", "pedestrian.standing")
CLASSES: Mapping[str, TaskClass] = {
    "car": TaskClass(50, attributes=_VEHICLE),
    "truck": TaskClass(50, attributes=_VEHICLE),
    "bus": TaskClass(50, attributes=_VEHICLE),
    "trailer": TaskClass(50, attributes=_VEHICLE),
    "construction_vehicle": TaskClass(50, attributes=_VEHICLE),
    "pedestrian": TaskClass(40, attributes=_PERSON),
    "motorcycle": TaskClass(40, attributes=_CYCLE),
    "bicycle": TaskClass(40, attributes=_CYCLE),
    "traffic_cone": TaskClass(30, ERRORS[:2]),
    "barrier": TaskClass(30, ERRORS[:3], np.pi),
}
ATTRIBUTES = (*_VEHICLE, *_CYCLE, *_PERSON)
IN_RACKS = ("bicycle", "motorcycle")  # not counted within a bicycle rack

PROTOCOL: Mapping[str, Any] = {
    "name": "nuScenes detection task, detection_cvpr_2019",
    "matching": (
        "by falling score, a detection matches the nearest free object of its class and sample whose centre is nearer "
        "than 0.5, 1, 2 or 4 m over the ground; of equal scores the later in the results comes first"
    ),
    "objects": (
        "objects and detections below the maximum distance of the class from the vehicle; objects with a point; bicycles "
        "and motorcycles outside of bicycle racks"
    ),
    "drives": (
        "of other data sets: all labelled boxes; distances from the LiDAR, velocities from the labels before and behind, no "
        "attributes and no racks; where labels are confined to an image, as in KITTI, detections beside it do not count, "
        "nor those without an object whose centre is beside it or in a DontCare region"
    ),
    "precision": (
        "AP: mean precision above 0.1 at recall 0.11, 0.12 .. 1, scaled to 1; mAP: mean over classes and distances"
    ),
    "errors": (
        "of matches at 2 m: distance of the centres (ATE), 1 - IoU of the aligned boxes (ASE), heading (AOE, of barriers "
        "modulo half a turn), velocity over the ground (AVE), 1 - accuracy of the attribute (AAE); mean of the cumulative "
        "means from recall 0.11 to the highest, 1 below it"
    ),
    "score": "NDS: (5 mAP + sum of max(1 - error, 0)) / 10",
    "values": {"classes": {name: one.max_distance_m for name, one in CLASSES.items()}},
}
