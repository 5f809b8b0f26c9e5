"""What flows between the stages: frozen, and refused at construction where the shape is wrong.

N points, M boxes, V voxels, H x W image. The LiDAR frame `velo` has x forward, y left, z up, in metres.
Other packages import all of it from here: `from perception.types import Frame`.
"""

from perception.types.detections import (
    DETECTOR_MODALITIES,
    MAP_MODALITIES,
    MODALITIES,
    Detections,
    DetectorModality,
    FusedDetections,
    MapModality,
    Modality,
    ModalityDetections,
)
from perception.types.drive import Drive, Labels, PointTruth
from perception.types.frame import Calibration, CameraImage, Frame
from perception.types.health import (
    CALIBRATION,
    CAMERA,
    INS,
    LIDAR,
    SENSOR_PARTS,
    Health,
    HealthFinding,
    HealthLevel,
)
from perception.types.lidar import LidarModel
from perception.types.objects import BoxDeviations, Boxes3D, Tracks, Vehicles
from perception.types.obstacles import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    GroundModel,
    Obstacles,
    OccupancyGrid,
    PointState,
    Voxels,
)
from perception.types.result import PipelineSnapshot, Result
from perception.types.stages import (
    Fit,
    KittiLayout,
    MapFilling,
    MapMethod,
    Method,
    OnBadFrame,
    Progress,
    StageSpan,
    relative_to_start,
)
from perception.types.table import (
    SHARED,
    ArrayTable,
    Bool,
    Complex64,
    Float,
    Float32,
    Float64,
    Int,
    UInt8,
    require_shape,
)

__all__ = [
    "CALIBRATION", "CAMERA", "DETECTOR_MODALITIES", "FREE", "INS", "LIDAR", "MAP_MODALITIES", "MODALITIES",
    "OCCUPIED", "SENSOR_PARTS", "SHARED", "UNKNOWN", "ArrayTable", "Bool", "BoxDeviations", "Boxes3D", "Calibration",
    "CameraImage", "Complex64", "Detections", "DetectorModality", "Drive", "Fit", "Float",
    "Float32", "Float64", "Frame", "FusedDetections", "GroundModel", "Health", "HealthFinding",
    "HealthLevel", "Int", "KittiLayout", "Labels", "LidarModel", "MapFilling", "MapMethod",
    "MapModality", "Method", "Modality", "ModalityDetections", "Obstacles", "OccupancyGrid", "OnBadFrame",
    "PipelineSnapshot", "PointState", "PointTruth", "Progress", "Result", "StageSpan", "Tracks",
    "UInt8", "Vehicles", "Voxels", "relative_to_start", "require_shape",
]  # fmt: skip
