"""Labelled scans with heights above the ground, and their labels all around or in the camera's view."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

import perception.obstacles
from data.array_store import Arrays, ArrayStore
from data.derived.motion_labels import LabelledAround, require_located
from data.frame_fingerprint import code_fingerprint
from data.kitti.labels import empty_labels, read_object_labels, read_tracking_labels
from data.kitti.objects import ObjectFrames
from data.label_proposals.proposed_labels import ProposedLabels
from data.labelled_objects import box_owners
from data.recorded_drive import RecordedDrive
from data.samples.cached_frames import CachedFrames
from data.synthetic.truth_files import truth_files
from perception.detection.bev import bev_map
from perception.detection.bev.bev_map import BevGrid, BevMapper
from perception.errors import CalibrationError
from perception.sensor import LidarModel
from perception.types import (
    SHARED,
    ArrayTable,
    Calibration,
    Drive,
    Float32,
    Float64,
    Frame,
    Int,
    Labels,
)

_ALL_AROUND, _NOWHERE = (0.0, np.pi), (0.0, -1.0)


@dataclass(frozen=True)
class BevObjects(ArrayTable):
    """M labelled objects of a scan from above.

    Attributes:
        boxes: (M, 7) x, y and height of the bottom above the ground, length, width, height, heading.
        types: (M,) types of the labels.
        returns: (M,) number of returns in each box.
        view_rad: (2,) middle and half width of the directions in which everything is labelled.
    """

    boxes: Annotated[Float32, 7]
    types: NDArray[np.str_]
    returns: Int
    view_rad: Annotated[Float32, SHARED]


@dataclass(frozen=True)
class LabelledScan:
    """A scan with its labels.

    Attributes:
        points_velo: (N, 4) points.
        heights_m: (N,) heights above the ground.
        labels: Labels of the scan.
    """

    points_velo: Float32
    heights_m: Float32
    labels: BevObjects


class LabelledScans(CachedFrames):
    """Scans of some drives; the heights above the ground and the labels of each are cached."""

    def __init__(
        self,
        drives: Sequence[Drive],
        grid: BevGrid,
        store: ArrayStore,
        proposals: Mapping[str, ProposedLabels] | None = None,
    ) -> None:
        """Number the scans.

        Args:
            drives: Drives with labels.
            grid: Cells of the map.
            store: Cache of heights and labels.
            proposals: Proposed labels by the name of a drive, in place of its own.
        """
        super().__init__(drives, store)
        self.grid, self.proposals = grid, dict(proposals or {})
        code = code_fingerprint(perception.obstacles, bev_map, Path(__file__))
        self._settings = {"reach_m": grid.reach_m, "code": code}

    def scan(self, number: int) -> LabelledScan:
        """Return a scan, by memory map where it is large.

        Raises:
            PerceptionError: a file of the frame cannot be read, or there are no labels.
        """
        arrays = self._arrays(number)
        return LabelledScan(arrays["points_velo"], arrays["heights_m"], self.labels(number))

    def labels(self, number: int) -> BevObjects:
        """Return the labels of a scan.

        Raises:
            PerceptionError: as `scan`.
        """
        arrays = self._arrays(number)
        return BevObjects(*(arrays[name] for name in ("boxes", "types", "returns", "view_rad")))

    def sensor(self, number: int) -> LidarModel:
        """Return the LiDAR model of a scan."""
        return self.place(number)[0].sensor

    def keys(self, number: int) -> list[str]:
        """Return the key of the arrays of a frame."""
        return [self._key(number, "bev", self._settings_of(number))]

    def make(self, number: int) -> None:
        """Make the arrays of a frame where they are not cached.

        Raises:
            PerceptionError: as `scan`.
        """
        self._arrays(number)

    def _arrays(self, number: int) -> Arrays:
        drive, index = self.place(number)
        return self.cached(
            number,
            "bev",
            self._settings_of(number),
            lambda frame: self._compute(drive, index, frame),
        )

    def _settings_of(self, number: int) -> dict[str, Any]:
        proposed = self.proposals.get(self.place(number)[0].name)
        return self._settings | ({"labels": proposed.fingerprint} if proposed else {})

    def _compute(self, drive: Drive, index: int, frame: Frame) -> Arrays:
        points_velo = frame.points_velo
        ground = _mapper(_Sensor(drive.sensor), self.grid).ground(points_velo)
        if (proposed := self.proposals.get(drive.name)) is not None:
            labels, view_rad = _or_nowhere(proposed.at(frame.name))
        else:
            labels, view_rad = _labels_around(drive, index, frame.calibration)
        boxes = labels.boxes_velo
        owners = box_owners(boxes, points_velo)
        bottoms_m = boxes.bottom_m.copy()
        if len(boxes):
            bottoms_m[:, 2] = ground.distance_m(boxes.bottom_m)
        columns = np.column_stack([bottoms_m, boxes.size_m, boxes.yaw_rad])
        return {
            "points_velo": points_velo,
            "heights_m": np.asarray(ground.distance_m(points_velo), np.float32),
            "boxes": columns.astype(np.float32),
            "types": labels.types.astype(np.str_),
            "returns": np.bincount(owners[owners >= 0], minlength=len(boxes)),
            "view_rad": np.array(view_rad, np.float32),
        }


class _Sensor:
    """A LiDAR model as a key: equal where it is the same object."""

    def __init__(self, model: LidarModel) -> None:
        self.model = model

    def __hash__(self) -> int:
        return id(self.model)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Sensor) and self.model is other.model


@lru_cache(maxsize=16)
def _mapper(sensor: _Sensor, grid: BevGrid) -> BevMapper:
    return BevMapper(sensor.model, grid)


def _labels_around(
    drive: Drive, index: int, calibration: Calibration | None
) -> tuple[Labels, tuple[float, float]]:
    """Return the labels of a frame, and the directions in which everything is labelled."""
    if isinstance(drive, LabelledAround):
        return _or_nowhere(drive.labels_around(index))
    if isinstance(drive, ObjectFrames) and calibration is not None:
        truth = drive.root / "truth_labels" / f"{drive.scans.paths[index].stem}.txt"
        if truth.is_file():
            return read_object_labels(truth, calibration), _ALL_AROUND
    if isinstance(drive, RecordedDrive) and (files := truth_files(drive)) is not None:
        assert drive.calibration is not None  # which truth files need
        labels = read_tracking_labels(files.labels, drive.calibration)
        return labels.get(drive.frame_numbers[index], empty_labels()), _ALL_AROUND
    if calibration is None or calibration.image_size_px is None:
        raise CalibrationError(
            drive.root,
            expected="labels of everything around, or a camera whose image has a size",
            found="neither",
        )
    in_view = drive.labels(index)
    require_located(in_view, drive.root)
    return in_view, _view_of(calibration)


def _or_nowhere(around: Labels | None) -> tuple[Labels, tuple[float, float]]:
    return (empty_labels(), _NOWHERE) if around is None else (around, _ALL_AROUND)


def _view_of(calibration: Calibration) -> tuple[float, float]:
    """Return the middle and half the width of the directions that an image shows, in rad about the vertical."""
    assert calibration.image_size_px is not None
    width, height = calibration.image_size_px
    edges_px: Float64 = np.array([[0.0, height / 2, 1.0], [width, height / 2, 1.0]])
    rays = edges_px @ np.linalg.inv(calibration.image_P_velo[:, :3]).T
    left, right = np.arctan2(rays[:, 1], rays[:, 0])
    half = np.mod(left - right, 2 * np.pi) / 2
    return float(right + half), float(half)
