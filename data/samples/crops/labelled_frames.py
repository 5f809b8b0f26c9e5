"""Labelled frames with what DepthCN's training needs of each: its input image, its proposals and its labels."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import perception.detection
import perception.detection.depthcn
import perception.maps
from data.array_store import Arrays, ArrayStore
from data.frame_fingerprint import code_fingerprint
from data.samples.cached_frames import CachedFrames
from perception.detection.config import ProposalConfig
from perception.detection.depthcn.crops import WindowKind
from perception.detection.depthcn.image import CHANNELS, encode_channels
from perception.detection.depthcn.proposals import propose
from perception.geometry.boxes import points_inside
from perception.geometry.camera import project
from perception.maps.densify import densify
from perception.maps.projection import camera_of, project_frame
from perception.types import Drive, Float64, Frame, Int, Labels, Method, UInt8

_MARGIN_M = 0.15  # labels are a little tight, and the beam has a width


@dataclass(frozen=True)
class CropConfig:
    """Input of a verifier network.

    Attributes:
        method: Method of the proposals, of the dense maps, and of the crops' interpolation.
        proposals: Parameters of the proposals; else the method's own.
        window: Part of the image around a proposal that is cropped; it also decides which are vehicles.
        channels: Channels of the input image, in the order of the network's input.
        classes: Names of the classes that the network tells apart, in the order of its scores.
    """

    method: Method = "default"
    proposals: ProposalConfig | None = None
    window: WindowKind = "metric"
    channels: tuple[str, ...] = CHANNELS
    classes: tuple[str, ...] = ("Car",)


@dataclass(frozen=True)
class ProposalScene:
    """P proposals and L labelled objects of one frame.

    Attributes:
        boxes_px: (P, 4) x1 y1 x2 y2 of the proposals.
        depths_m: (P,) depth of the near side of each.
        shares: (P, L) fraction of a proposal's points within a label's 3D box.
        label_types: (L,) class names.
        label_boxes_px: (L, 4) x1 y1 x2 y2 of the labels.
        label_depths_m: (L,) depth of the nearest point within, NaN where there is none.
        label_points: (L,) number of points within.
        dont_care_px: (D, 4) regions without labels.
        focal_px: Focal length of the camera.
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


class LabelledFrames(CachedFrames):
    """Frames of some drives; input image and proposals of each are cached."""

    def __init__(self, drives: Sequence[Drive], config: CropConfig, store: ArrayStore) -> None:
        """Number the frames.

        Args:
            drives: Drives with labels and the camera's calibration.
            config: Input of the network.
            store: Cache of images and scenes.
        """
        super().__init__(drives, store)
        self.config = config

    def image(self, number: int) -> UInt8:
        """Return the (H, W, 3) input image of a frame, by memory map.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it has no camera.
        """
        drive, _ = self.place(number)
        method = self.config.method

        def compute(frame: Frame) -> Arrays:
            return {"image": _make_image(frame, method, drive.sensor.height_m)}

        return self.cached(number, "image", self._image_settings, compute)["image"]

    def scene(self, number: int) -> ProposalScene:
        """Return proposals and labels of a frame.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it has no camera or no labels.
        """
        drive, index = self.place(number)
        config = self.config

        def compute(frame: Frame) -> Arrays:
            return asdict(_scene(frame, drive.labels(index), config))

        return _to_scene(self.cached(number, "scene", self._scene_settings, compute))

    def keys(self, number: int) -> list[str]:
        """Return the keys of image and scene of a frame."""
        return [
            self._key(number, "image", self._image_settings),
            self._key(number, "scene", self._scene_settings),
        ]

    def make(self, number: int) -> None:
        """Make image and scene of a frame where they are not cached.

        Raises:
            PerceptionError: as `scene`.
        """
        self.image(number)
        self.scene(number)

    @property
    def _image_settings(self) -> dict[str, Any]:
        return {"method": self.config.method, "code": _code()}

    @property
    def _scene_settings(self) -> dict[str, Any]:
        config = self.config
        proposals = None if config.proposals is None else asdict(config.proposals)
        return {"method": config.method, "proposals": proposals, "code": _code()}


def _make_image(frame: Frame, method: Method, lidar_height_m: float) -> UInt8:
    calibration, _ = camera_of(frame)
    dense = densify(project_frame(frame), method)
    return encode_channels(dense, calibration.image_P_velo, lidar_height_m)


def _scene(frame: Frame, labels: Labels, config: CropConfig) -> ProposalScene:
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
    """Return a scene from its cached arrays."""
    values: dict[str, Any] = {**arrays, "focal_px": float(arrays["focal_px"])}
    return ProposalScene(**values)


def _shares(clusters: Int, is_within: np.ndarray, count: int) -> Float64:
    """Return the (P, L) fraction of each cluster's points within each of the (L, N) masks."""
    rows = np.flatnonzero(clusters >= 0)
    sizes = np.bincount(clusters[rows], minlength=count)
    inside = [np.bincount(clusters[rows], within[rows], count) for within in is_within]
    return np.reshape(inside, (-1, count)).T / np.maximum(sizes, 1)[:, None]


def _code() -> str:
    return code_fingerprint(
        perception.detection, perception.detection.depthcn, perception.maps, Path(__file__)
    )
