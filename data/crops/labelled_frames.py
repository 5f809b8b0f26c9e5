"""Labelled frames as training sees them: the picture, and what proposals and labels have in common.

Both take long to make and are kept in an `ArrayStore`, under a key of all that makes them: the frame's files,
the settings, and the code itself.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import perception.detection
import perception.detection.depthcn
import perception.maps
from data.array_store import Arrays, ArrayStore, entry_key
from data.frame_fingerprint import code_fingerprint, frame_fingerprint
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.proposals import propose
from perception.geometry.boxes import points_inside
from perception.geometry.camera import project
from perception.maps.densify import densify
from perception.maps.projection import camera_of, project_frame
from perception.types import Drive, Float64, Frame, Int, Labels, Method, UInt8

_MARGIN_M = 0.15  # labels are a little tight, and the beam has a width


@dataclass(frozen=True)
class FrameConfig:
    """What a frame's picture and proposals depend on.

    Attributes:
        method: by which proposals are found and maps made.
        proposals: rules by which candidates are found; else the method's own.
    """

    method: Method = "default"
    proposals: ProposalConfig | None = None


@dataclass(frozen=True)
class ProposalScene:
    """P proposals and L labelled objects of one frame.

    Attributes:
        boxes_px: (P, 4) x1 y1 x2 y2 of the proposals.
        depths_m: (P,) of their near sides.
        shares: (P, L) how much of a proposal's points lies within a label's 3D box.
        label_types: (L,) class names.
        label_boxes_px: (L, 4).
        label_depths_m: (L,) of the nearest return within, NaN where there is none.
        label_points: (L,) how many returns lie within.
        dont_care_px: (D, 4) regions in which nothing was labelled.
        focal_px: of the camera.
    """

    boxes_px: Float64
    depths_m: Float64
    shares: Float64
    label_types: np.ndarray
    label_boxes_px: Float64
    label_depths_m: Float64
    label_points: Int
    dont_care_px: Float64
    focal_px: float


class LabelledFrames:
    """The frames of some drives, numbered through; what is made of each is kept in a store."""

    def __init__(self, drives: Sequence[Drive], config: FrameConfig, store: ArrayStore) -> None:
        """Number the frames.

        Args:
            drives: with labels and a camera's calibration.
            config: how frames are looked at.
            store: where pictures and scenes are kept.
        """
        self.drives, self.config, self.store = tuple(drives), config, store
        self._image_keys: dict[int, str] = {}  # worth keeping: a picture is asked for often
        self._places = [(drive, index) for drive in drives for index in range(len(drive))]
        self.drive_numbers: Int = np.repeat(np.arange(len(drives)), [len(d) for d in drives])

    def __len__(self) -> int:
        return len(self._places)

    def image(self, number: int) -> UInt8:
        """Return the (H, W, 3) picture of a frame, by memory map.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it has no camera.
        """
        drive, index = self._places[number]
        if number not in self._image_keys:
            origin = _origin(drive, index)
            self._image_keys[number] = entry_key(
                what="picture", method=self.config.method, **origin
            )

        def make() -> Arrays:
            return {"picture": _make_image(drive[index], self.config.method, drive.sensor.height_m)}

        return self.store.get(self._image_keys[number], make)["picture"]

    def scene(self, number: int) -> ProposalScene:
        """Return proposals and labels of a frame.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it has no camera or no labels.
        """
        drive, index = self._places[number]
        key = entry_key(what="scene", config=asdict(self.config), **_origin(drive, index))

        def make() -> Arrays:
            return asdict(_scene(drive[index], drive.labels(index), self.config))

        return _to_scene(self.store.get(key, make))


def _make_image(frame: Frame, method: Method, lidar_height_m: float) -> UInt8:
    calibration, _ = camera_of(frame)
    dense = densify(project_frame(frame), method)
    return encode_channels(dense, calibration.image_P_velo, lidar_height_m)


def _scene(frame: Frame, labels: Labels, config: FrameConfig) -> ProposalScene:
    calibration, size_px = camera_of(frame)
    points_velo = frame.points_velo
    proposals = propose(points_velo, calibration, size_px, config.proposals, config.method)
    is_within = points_inside(labels.boxes_velo, frame.points_velo, _MARGIN_M)
    _, depth_m = project(calibration.image_P_velo, frame.points_velo)
    nearest_m = np.where(is_within & (depth_m > 0), depth_m, np.inf).min(axis=1, initial=np.inf)
    return ProposalScene(
        boxes_px=proposals.boxes_px,
        depths_m=proposals.depths_m,
        shares=_shares(proposals.clusters, is_within, len(proposals)),
        label_types=labels.types.astype(np.str_),
        label_boxes_px=labels.boxes_px,
        label_depths_m=np.where(np.isfinite(nearest_m), nearest_m, np.nan),
        label_points=is_within.sum(axis=1),
        dont_care_px=labels.dont_care_px,
        focal_px=float(calibration.image_P_cam[0, 0]),
    )


def _to_scene(arrays: Arrays) -> ProposalScene:
    """Return the scene that a store kept, whose focal length is an array there."""
    kept: dict[str, Any] = {**arrays, "focal_px": float(arrays["focal_px"])}
    return ProposalScene(**kept)


def _shares(clusters: Int, is_within: np.ndarray, count: int) -> Float64:
    """Return (P, L) which share of the points of each cluster lies within each of (L, N)."""
    rows = np.flatnonzero(clusters >= 0)
    sizes = np.bincount(clusters[rows], minlength=count)
    inside = [np.bincount(clusters[rows], within[rows], count) for within in is_within]
    return np.reshape(inside, (-1, count)).T / np.maximum(sizes, 1)[:, None]


def _origin(drive: Drive, index: int) -> dict[str, Any]:
    code = code_fingerprint(
        perception.detection, perception.detection.depthcn, perception.maps, Path(__file__)
    )
    return {**frame_fingerprint(drive, index), "code": code}
