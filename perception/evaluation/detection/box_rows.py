"""Labelled and detected boxes of many frames, one row a box, with its 3D box where there is one.

3D boxes lie in the upright camera frame: the rectified camera frame of KITTI with its axes renamed, x forward (z of
KITTI), y left (-x), z up (-y), so that `Boxes3D` and its overlaps apply. A heading ry is a yaw of -ry - pi/2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Self

import numpy as np

from perception.errors import PerceptionError
from perception.evaluation.detection.protocol import NO_ALPHA_RAD
from perception.geometry.boxes import (
    observation_angles_rad,
    usual_observation_angles_rad,
)
from perception.types import ArrayTable, Boxes3D, Calibration, Detections, Float64, Int, Labels

# Values of KITTI's rows without a 3D box. The official tool treats them as a box of this size at this place.
_NO_SIZE_M, _NO_PLACE_M, _NO_HEADING_RAD = -1.0, -1000.0, -10.0


def upright_boxes(columns: Float64) -> Boxes3D:
    """Return (M) boxes in the upright camera frame from (M, 7) h w l x y z ry of KITTI's rows."""
    height, width, length, x, y, z, heading_rad = columns.T
    return Boxes3D(
        bottom_m=np.column_stack([z, -x, -y]),
        size_m=np.column_stack([length, width, height]),
        yaw_rad=-heading_rad - np.pi / 2,
    )


def unknown_boxes(count: int) -> Boxes3D:
    """Return boxes in place of unknown ones, as the official tool reads them."""
    row = [_NO_SIZE_M] * 3 + [_NO_PLACE_M] * 3 + [_NO_HEADING_RAD]
    return upright_boxes(np.tile(row, (count, 1)))


def in_upright_camera(boxes_velo: Boxes3D, camera: Calibration) -> Boxes3D:
    """Return boxes of the LiDAR frame in the upright camera frame, unknown ones in place of those of NaN.

    Their yaw stays, as `data.kitti` converts labels and results.
    """
    x, y, z = (boxes_velo.bottom_m @ camera.cam_SE3_velo[:3, :3].T + camera.cam_SE3_velo[:3, 3]).T
    boxes = Boxes3D(np.column_stack([z, -x, -y]), boxes_velo.size_m, boxes_velo.yaw_rad)
    rows = np.flatnonzero(np.isnan(boxes.bottom_m).any(axis=1) | np.isnan(boxes.yaw_rad))
    return boxes.replaced(rows, unknown_boxes(len(rows)))


@dataclass(frozen=True)
class LocatedDetections:
    """Detections of one frame with their 3D boxes.

    Attributes:
        detections: (M) detections in the image.
        boxes_velo: (M) boxes in the LiDAR frame, rows of NaN where they are not known.
        camera: Calibration of the camera.
    """

    detections: Detections
    boxes_velo: Boxes3D
    camera: Calibration


@dataclass(frozen=True)
class _BoxRows(ArrayTable):
    """M boxes in the order of their frames; within a frame, the order decides between equal scores.

    Attributes:
        frames: (M,) frame numbers from 0, in ascending order.
        types: (M,) class names, in any case.
        alphas_rad: (M,) observation angles of the headings; -10 where unknown.
        boxes_px: (M, 4) x1 y1 x2 y2.
        boxes_3d: (M) boxes in the upright camera frame, `unknown_boxes` in place of those that are not known; none
            at all stands for M unknown ones.
    """

    frames: Int
    types: np.ndarray
    alphas_rad: Float64
    boxes_px: Annotated[Float64, 4]
    boxes_3d: Boxes3D = field(default_factory=Boxes3D.empty, kw_only=True)

    def __post_init__(self) -> None:
        """Validate lengths and shapes, finite numbers, and the order of the frames; fill in unknown 3D boxes."""
        if len(self.boxes_3d) == 0:
            object.__setattr__(self, "boxes_3d", unknown_boxes(len(self.frames)))
        super().__post_init__()
        what = type(self).__name__
        for name, column in {**vars(self), **vars(self.boxes_3d)}.items():
            is_number = isinstance(column, np.ndarray) and column.dtype.kind == "f"
            if is_number and not np.isfinite(column).all():
                raise PerceptionError(
                    f"{what}.{name}", expected="finite numbers", found="NaN or infinity"
                )
        if (np.diff(self.frames, prepend=0) < 0).any():
            raise PerceptionError(
                f"{what}.frames", expected="frames from 0 in ascending order", found="another order"
            )


@dataclass(frozen=True)
class TrueBoxes(_BoxRows):
    """G labelled boxes; regions without labels have the type DontCare.

    Attributes:
        truncation: (G,) share outside the image, 0 to 1; -1 of regions.
        occlusion: (G,) levels 0 to 3; -1 of regions.
    """

    truncation: Float64
    occlusion: Float64

    @classmethod
    def of_frames(
        cls, labels: Sequence[Labels], cameras: Sequence[Calibration] | None = None
    ) -> Self:
        """Return the labels of one frame after the other, each frame's DontCare regions after its objects.

        Only with the cameras of the frames have they 3D boxes and headings.

        Truncation stays as labelled, also where it is a level of tracking labels: 0 is within every limit on the
        share, 1 and 2 are beyond. Of the 18,472 objects in the labels of both of KITTI's benchmarks, 97 % of
        level 0 are truncated by no more than 0.15 and all by no more than 0.5, all but four of 1,050 of level 1
        by more than 0.5; of level 2, half of 633 are whole.
        """
        seen_by: Sequence[Calibration | None] = cameras or [None] * len(labels)
        frames = enumerate(zip(labels, seen_by, strict=True))
        return cls.concatenate(cls._of_frame(number, *one) for number, one in frames)

    @classmethod
    def _of_frame(cls, number: int, labels: Labels, camera: Calibration | None) -> Self:
        regions = np.full(len(labels.dont_care_px), -1.0)
        types = [*labels.types.tolist(), *["DontCare"] * len(regions)]
        alphas_rad = np.full(len(types), NO_ALPHA_RAD)
        boxes_3d = unknown_boxes(len(types))
        if camera is not None:
            rows = np.arange(len(labels))
            alphas_rad[rows] = observation_angles_rad(labels.boxes_velo)
            boxes_3d = boxes_3d.replaced(rows, in_upright_camera(labels.boxes_velo, camera))
        return cls(
            frames=np.full(len(types), number),
            types=np.array(types, np.str_),
            alphas_rad=alphas_rad,
            boxes_3d=boxes_3d,
            boxes_px=np.concatenate([labels.boxes_px, labels.dont_care_px], dtype=np.float64),
            truncation=np.append(labels.truncation, regions),
            occlusion=np.append(labels.occlusion, regions),
        )


@dataclass(frozen=True)
class DetectedBoxes(_BoxRows):
    """D detected boxes.

    Attributes:
        scores: (D,) scores of any scale, the higher the more confident.
    """

    scores: Float64

    @classmethod
    def of_frames(cls, detections: Sequence[Detections]) -> Self:
        """Return the detections of one frame after the other, without headings."""
        whole = Detections.concatenate(detections)
        counts = [len(found) for found in detections]
        return cls(
            frames=np.repeat(np.arange(len(counts)), counts),
            types=whole.types,
            alphas_rad=np.full(len(whole), NO_ALPHA_RAD),
            boxes_px=whole.boxes_px.astype(np.float64),
            scores=whole.scores.astype(np.float64),
        )

    @classmethod
    def of_located(cls, located: Sequence[LocatedDetections]) -> Self:
        """Return the detections of one frame after the other, with their 3D boxes and headings.

        A detection without a 3D box has the usual heading, as in the result files of `trifuse run`.
        """
        rows = cls.of_frames([one.detections for one in located])
        alphas_rad = [_observation_angles_rad(one) for one in located]
        boxes = [in_upright_camera(one.boxes_velo, one.camera) for one in located]
        return replace(
            rows,
            alphas_rad=np.concatenate([np.zeros(0), *alphas_rad]),
            boxes_3d=Boxes3D.concatenate(boxes),
        )


def _observation_angles_rad(located: LocatedDetections) -> Float64:
    known_rad = observation_angles_rad(located.boxes_velo)
    usual_rad = usual_observation_angles_rad(located.detections.boxes_px, located.camera)
    return np.where(np.isnan(known_rad), usual_rad, known_rad)
