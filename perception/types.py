"""What flows between the stages: frozen, and refused at construction where the shape is wrong.

N points, M boxes, V voxels, H x W image. The LiDAR frame `velo` has x forward, y left, z up, in metres.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal, Protocol, Self, get_args

import numpy as np
from numpy.typing import NDArray

from perception.errors import CalibrationError, ImageError, PerceptionError, PoseError, ScanError

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Complex64 = NDArray[np.complex64]
Float = NDArray[np.float32] | NDArray[np.float64]
Int = NDArray[np.int32] | NDArray[np.int64]
UInt8 = NDArray[np.uint8]
Bool = NDArray[np.bool_]

# By which form of a stage: ours, or the thesis' own.
Method = Literal["default", "thesis"]
# A view of the road that a detector looks at: the camera's image, the depth map, the reflectance map.
Modality = Literal["rgb", "dm", "rm"]
MODALITIES: tuple[Modality, ...] = get_args(Modality)
# Those of them that are made of the LiDAR's returns.
MapModality = Literal["dm", "rm"]
MAP_MODALITIES: tuple[MapModality, ...] = get_args(MapModality)
# Goes through numbers, such as of frames, and may show how far it is.
Progress = Callable[[Iterable[int]], Iterable[int]]


def _require_shape(what: str, array: NDArray[Any], expected: tuple[int | str, ...]) -> None:
    fits = array.ndim == len(expected)
    for have, want in zip(array.shape, expected, strict=False):
        fits &= have == want or isinstance(want, str)
    if not fits:
        shape = "(" + ", ".join(map(str, expected)) + ")"
        raise PerceptionError(what, expected=f"shape {shape}", found=f"shape {array.shape}")


@dataclass(frozen=True)
class Calibration:
    """A rectified pinhole camera and where the LiDAR sits before it.

    Attributes:
        image_P_cam: (3, 4) projection of the rectified reference camera's frame to pixels; KITTI's P2.
        cam_SE3_velo: (4, 4) LiDAR to rectified reference camera; KITTI's R0_rect * Tr_velo_to_cam.
        image_size_px: (width, height) where the calibration states it.
        source: the file, for error messages.
    """

    image_P_cam: Float64
    cam_SE3_velo: Float64
    image_size_px: tuple[int, int] | None = None
    source: str = "calibration"

    def __post_init__(self) -> None:
        """Refuse matrices that cannot project."""
        _require_shape(f"{self.source} image_P_cam", self.image_P_cam, (3, 4))
        _require_shape(f"{self.source} cam_SE3_velo", self.cam_SE3_velo, (4, 4))
        for name, square in (
            ("image_P_cam", self.image_P_cam[:, :3]),
            ("cam_SE3_velo", self.cam_SE3_velo),
        ):
            if not np.isfinite(square).all() or abs(np.linalg.det(square)) < 1e-9:
                raise CalibrationError(
                    self.source, expected=f"an invertible {name}", found="a singular matrix"
                )

    @property
    def image_P_velo(self) -> Float64:
        """(3, 4) projection from the LiDAR frame to pixels (3.1)."""
        return self.image_P_cam @ self.cam_SE3_velo


@dataclass(frozen=True)
class Frame:
    """What the sensors saw at one moment.

    Attributes:
        index: number of the frame within its drive.
        stamp_s: time of the scan.
        points_velo: (N, 4) x, y, z in metres and reflectance 0..1.
        image: (H, W, 3) RGB, or None without a camera.
        world_SE3_velo: (4, 4) INS pose of the LiDAR in a frame fixed to the earth, or None without INS.
        calibration: of the camera, or None.
        source: the scan's file, for error messages.
    """

    index: int
    stamp_s: float
    points_velo: Float32
    image: UInt8 | None = None
    world_SE3_velo: Float64 | None = None
    calibration: Calibration | None = None
    source: str = "frame"

    def __post_init__(self) -> None:
        """Refuse empty or non-finite scans, malformed poses, and an image of another size."""
        self._check_scan()
        if self.world_SE3_velo is not None:
            _require_shape(f"{self.source} world_SE3_velo", self.world_SE3_velo, (4, 4))
            if not np.isfinite(self.world_SE3_velo).all():
                raise PoseError(self.source, expected="a finite pose", found="NaN or infinity")
        if self.image is not None:
            self._check_image(self.image)

    def _check_scan(self) -> None:
        _require_shape(f"{self.source} points_velo", self.points_velo, ("N", 4))
        if len(self.points_velo) == 0:
            raise ScanError(self.source, expected="at least one point", found="an empty scan")
        finite: Bool = np.asarray(np.isfinite(self.points_velo).all(axis=1))
        if not finite.all():
            raise ScanError(
                self.source,
                expected="finite coordinates",
                found=f"{int((~finite).sum())} of {len(finite)} points with NaN or infinity",
                advice="drop these points when you record the scan",
            )
        low, high = self.points_velo[:, 3].min(), self.points_velo[:, 3].max()
        if low < 0 or high > 1:
            raise ScanError(
                self.source,
                expected="reflectance from 0 to 1",
                found=f"{low:g} to {high:g}",
                advice="divide it by the sensor's full scale, 255 for most",
            )

    def _check_image(self, image: UInt8) -> None:
        _require_shape(f"{self.source} image", image, ("H", "W", 3))
        size = self.calibration.image_size_px if self.calibration else None
        height, width = image.shape[:2]
        if size is not None and size != (width, height):
            raise ImageError(
                self.source,
                expected=f"an image of {size[0]}x{size[1]} pixels as its calibration says",
                found=f"{width}x{height}",
            )


@dataclass(frozen=True)
class Boxes3D:
    """M upright boxes in one frame, the LiDAR's unless the variable's name says otherwise.

             front
          +---^---+      bottom_m: centre of the bottom face
          |   |   |      size_m:   length (along the heading), width, height
    left  |   o   |      yaw_rad:  of the heading, from +x towards +y
          +-------+

    """

    bottom_m: Float64
    size_m: Float64
    yaw_rad: Float64

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        _require_shape("Boxes3D.bottom_m", self.bottom_m, ("M", 3))
        _require_shape("Boxes3D.size_m", self.size_m, (len(self.bottom_m), 3))
        _require_shape("Boxes3D.yaw_rad", self.yaw_rad, (len(self.bottom_m),))

    def __len__(self) -> int:
        """Return M."""
        return len(self.bottom_m)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the boxes of a mask, of indices, or of a slice."""
        return type(self)(self.bottom_m[rows], self.size_m[rows], self.yaw_rad[rows])

    @classmethod
    def empty(cls) -> Self:
        """Return no boxes."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


class GroundModel(Protocol):
    """A ground surface in the LiDAR frame. Every ground method returns one."""

    def height_m(self, xy_m: Float) -> Float64:
        """Return (N,) the z of the ground at (N, 2) positions."""
        ...

    def distance_m(self, points_velo: Float) -> Float:
        """Return (N,) signed distances of (N, 3+) points along the ground's normal, up positive."""
        ...


class PointState(IntEnum):
    """What the obstacle stage says of one LiDAR point."""

    OUTSIDE = 0  # beyond the local area
    GROUND = 1
    STATIC = 2
    MOVING = 3


@dataclass(frozen=True)
class Voxels:
    """V occupied cubes of one grid.

    Attributes:
        centers_m: (V, 3).
        counts: (V,) points in each, the thesis' occupancy value (2.1.2).
        size_m: edge of a cube.
    """

    centers_m: Float32
    counts: Int
    size_m: float

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        _require_shape("Voxels.centers_m", self.centers_m, ("V", 3))
        _require_shape("Voxels.counts", self.counts, (len(self.centers_m),))

    def __len__(self) -> int:
        """Return V."""
        return len(self.centers_m)


@dataclass(frozen=True)
class Obstacles:
    """What stands on the ground in one scan, in the LiDAR frame of that scan.

    Attributes:
        point_states: (N,) one `PointState` for each point of the frame.
        static: voxels of the static model, seen in this scan or a recent one.
        moving: voxels of this scan that move.
    """

    point_states: UInt8
    static: Voxels
    moving: Voxels


@dataclass(frozen=True)
class Tracks:
    """T objects followed over time, as they are at the moment of one scan, in the LiDAR frame of that scan.

    Attributes:
        ids: (T,) rising; a tracker never gives one twice.
        boxes: (T)
        velocities_m_s: (T, 2) over the ground, not relative to the vehicle, along x and y of the LiDAR frame.
        is_seen: (T,) measured in this scan; the others are predicted.
    """

    ids: Int
    boxes: Boxes3D
    velocities_m_s: Float64
    is_seen: Bool

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        count = len(self.ids)
        _require_shape("Tracks.boxes.yaw_rad", self.boxes.yaw_rad, (count,))
        _require_shape("Tracks.velocities_m_s", self.velocities_m_s, (count, 2))
        _require_shape("Tracks.is_seen", self.is_seen, (count,))

    def __len__(self) -> int:
        """Return T."""
        return len(self.ids)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the tracks of a mask, of indices, or of a slice."""
        return type(self)(
            self.ids[rows], self.boxes[rows], self.velocities_m_s[rows], self.is_seen[rows]
        )

    @classmethod
    def empty(cls) -> Self:
        """Return no tracks."""
        return cls(np.zeros(0, np.int64), Boxes3D.empty(), np.zeros((0, 2)), np.zeros(0, bool))


@dataclass(frozen=True)
class Detections:
    """M objects that a detector sees in one image.

    Attributes:
        boxes_px: (M, 4) x1 y1 x2 y2.
        scores: (M,) 0..1.
        types: (M,) class names, spelled as in labels: Car ...
    """

    boxes_px: Float64
    scores: Float64
    types: NDArray[np.str_]

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        _require_shape("Detections.boxes_px", self.boxes_px, ("M", 4))
        _require_shape("Detections.scores", self.scores, (len(self.boxes_px),))
        _require_shape("Detections.types", self.types, (len(self.boxes_px),))

    def __len__(self) -> int:
        """Return M."""
        return len(self.boxes_px)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the detections of a mask, of indices, or of a slice."""
        return type(self)(self.boxes_px[rows], self.scores[rows], self.types[rows])

    @classmethod
    def empty(cls) -> Self:
        """Return no detections."""
        return cls(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.str_))


# What the detector of each modality sees; one that did not look has no entry.
ModalDetections = Mapping[Modality, Detections]


@dataclass(frozen=True)
class FusedDetections:
    """M objects after joint rescoring, best first, and what they were made of.

    Attributes:
        detections: (M)
        parts: (M, 3) row in the detections of each of `MODALITIES`, -1 where that detector saw nothing.
        carriers: (M,) column of the modality that carried the detection most.
    """

    detections: Detections
    parts: Int
    carriers: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        count = len(self.detections)
        _require_shape("FusedDetections.parts", self.parts, (count, len(MODALITIES)))
        _require_shape("FusedDetections.carriers", self.carriers, (count,))

    def __len__(self) -> int:
        """Return M."""
        return len(self.detections)

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the detections of a mask, of indices, or of a slice."""
        return type(self)(self.detections[rows], self.parts[rows], self.carriers[rows])

    @classmethod
    def empty(cls) -> Self:
        """Return no detections."""
        return cls(
            Detections.empty(), np.zeros((0, len(MODALITIES)), np.int64), np.zeros(0, np.int64)
        )


@dataclass(frozen=True)
class Vehicles:
    """M detected vehicles as objects on the road, in the LiDAR frame of one scan of N points.

    Attributes:
        fused: (M) what the detectors saw.
        ids: (M,) track ids, those of `Tracks` where an object is followed by both; -1 before one is given.
        boxes: (M) 3D boxes on the ground; rows of NaN where the LiDAR says too little.
        distances_m: (M,) from the LiDAR to the nearest return, NaN without one.
        velocities_m_s: (M, 2) over the ground along x and y of the LiDAR frame, NaN before it is known.
        owners: (N,) for each point the vehicle that it belongs to, or -1.
    """

    fused: FusedDetections
    ids: Int
    boxes: Boxes3D
    distances_m: Float64
    velocities_m_s: Float64
    owners: Int

    def __post_init__(self) -> None:
        """Refuse arrays of different lengths."""
        count = len(self.fused)
        _require_shape("Vehicles.ids", self.ids, (count,))
        _require_shape("Vehicles.boxes.yaw_rad", self.boxes.yaw_rad, (count,))
        _require_shape("Vehicles.distances_m", self.distances_m, (count,))
        _require_shape("Vehicles.velocities_m_s", self.velocities_m_s, (count, 2))

    def __len__(self) -> int:
        """Return M."""
        return len(self.fused)


@dataclass(frozen=True)
class StageSpan:
    """When one stage worked on a frame.

    Attributes:
        stage: its name.
        worker: that ran it, one stage after another.
        start_s: since the frame arrived.
        stop_s: since the frame arrived.
    """

    stage: str
    worker: str
    start_s: float
    stop_s: float


@dataclass(frozen=True)
class Result:
    """What the pipeline made of one frame.

    Attributes:
        frame: what it was given.
        world_SE3_velo: (4, 4) pose after registration.
        ground: the ground surface in the LiDAR frame.
        obstacles: static and moving.
        tracks: what moves, as objects with an identity.
        modal: what each detector saw by itself; empty where detection is off.
        map_pictures: (H, W) of each map that they looked at, 0 where nothing is known.
        vehicles: what they say together, None where detection is off.
        depthcn: what DepthCN saw, None where it is off.
        timings_s: seconds by stage; what overlaps counts more than once.
        spans: when each stage ran, stages of one worker in their order.
    """

    frame: Frame
    world_SE3_velo: Float64
    ground: GroundModel
    obstacles: Obstacles
    tracks: Tracks = field(default_factory=Tracks.empty)
    modal: ModalDetections = field(default_factory=dict)
    map_pictures: Mapping[Modality, UInt8] = field(default_factory=dict)
    vehicles: Vehicles | None = None
    depthcn: Detections | None = None
    timings_s: dict[str, float] = field(default_factory=dict)
    spans: tuple[StageSpan, ...] = ()

    @property
    def latency_s(self) -> float:
        """From the arrival of the frame to its last stage's end, or NaN where that was not taken."""
        return max((span.stop_s for span in self.spans), default=float("nan"))
