"""Results of the pipeline in nuScenes' form: the detected vehicles of each sample in the world of the drive."""

from typing import Any

import numpy as np

from data.labelled_objects import task_classes
from data.recorded_drive import RecordedDrive
from perception.evaluation.nuscenes.protocol import CLASSES, MAX_BOXES
from perception.geometry.boxes import transform_boxes
from perception.snapshot import Restorable
from perception.types import Bool, Float64, Result, Vehicles

_MIN_SPEED_M_S = 0.5  # of a moving object, as in the labels of scene flow
_RIDER = "Cyclist"


class ResultEntries(Restorable):
    """Collects the detected vehicles of the samples of a drive.

    A vehicle moves from 0.5 m/s on; a slower one has stopped where it has moved before, and else is parked.
    """

    memories = ("_samples", "_moved", "_has_images")

    def __init__(self, drive: RecordedDrive) -> None:
        """Start without a sample.

        Args:
            drive: Drive of the results.
        """
        self._drive = drive
        self._samples: dict[str, list[dict[str, Any]]] = {}
        self._moved: set[int] = set()
        self._has_images = False

    def add(self, result: Result) -> None:
        """Add the vehicles of one frame that have a 3D box and a class; of a frame that is no sample, only their motion."""
        vehicles, index = result.vehicles, result.frame.index
        token = self._drive.sample_token(index)
        of_cameras = (result.modality_detections, *result.further_detections)
        self._has_images |= any("rgb" in one for one in of_cameras)
        if token is not None:
            self._samples[token] = [] if vehicles is None else self._entries(token, index, vehicles)
        if vehicles is not None:
            is_tracked = _are_moving(vehicles) & (vehicles.ids >= 0)
            self._moved |= set(vehicles.ids[is_tracked].tolist())

    def document(self) -> dict[str, Any]:
        """Return the document of nuScenes' form, with the drive that samples without tokens are frames of."""
        return {
            "meta": {
                "use_camera": self._has_images,
                "use_lidar": True,
                "use_radar": False,
                "use_map": False,
                "use_external": True,  # the networks learned from other data
                "drive": self._drive.name,
            },
            "results": self._samples,
        }

    def _entries(self, token: str, index: int, vehicles: Vehicles) -> list[dict[str, Any]]:
        # Boxes match by their places: what counts is that an object is there, not how well a rectangle fits.
        scores = vehicles.scan_existence
        detections, pose = vehicles.fused.detections, self._drive.map_SE3_velo(index)
        is_moving, types = _are_moving(vehicles), task_classes(detections.types.tolist())
        boxes = transform_boxes(pose, vehicles.boxes)
        centers_m = boxes.centers_m
        velocities_m_s = np.nan_to_num(vehicles.velocities_m_s) @ pose[:2, :2].T
        rows = np.flatnonzero((types != "") & np.isfinite(boxes.yaw_rad))
        rows = rows[np.argsort(-scores[rows], kind="stable")][:MAX_BOXES]
        return [
            {
                "sample_token": token,
                "translation": _rounded(centers_m[row], 4),
                "size": _rounded(boxes.size_m[row, [1, 0, 2]], 4),
                "rotation": _rounded(_quaternion(float(boxes.yaw_rad[row])), 6),
                "velocity": _rounded(velocities_m_s[row], 4),
                "detection_name": str(types[row]),
                "detection_score": round(float(scores[row]), 6),
                "attribute_name": self._attribute(
                    str(types[row]),
                    str(detections.types[row]),
                    int(vehicles.ids[row]),
                    is_moving=bool(is_moving[row]),
                ),
            }
            for row in rows.tolist()
        ]

    def _attribute(self, name: str, kind: str, track: int, *, is_moving: bool) -> str:
        known = CLASSES[name].attributes
        group = known[0].partition(".")[0] if known else ""
        if group == "cycle":
            return f"cycle.{'with' if kind == _RIDER else 'without'}_rider"
        if group == "pedestrian":
            return f"pedestrian.{'moving' if is_moving else 'standing'}"
        if group == "vehicle":
            still = "stopped" if track in self._moved else "parked"
            return f"vehicle.{'moving' if is_moving else still}"
        return ""


def _are_moving(vehicles: Vehicles) -> Bool:
    return np.asarray(np.linalg.norm(vehicles.velocities_m_s, axis=1) >= _MIN_SPEED_M_S)


def _quaternion(yaw_rad: float) -> Float64:
    return np.array([np.cos(yaw_rad / 2), 0.0, 0.0, np.sin(yaw_rad / 2)])


def _rounded(values: Float64, digits: int) -> list[float]:
    numbers: list[float] = (np.round(values, digits) + 0.0).tolist()  # without the sign of -0.0
    return numbers
