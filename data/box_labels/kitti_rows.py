"""KITTI's rows without a camera: in the axes of the scans, or in those of a camera that looks straight ahead.

    [frame id] type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  angle

A row of eight words, `x y z length width height angle type`, is that of custom data sets of detection suites.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    as_stated,
    from_bottom,
    rounded,
    write_document,
)
from data.kitti.labels import DONT_CARE
from data.kitti.rows import to_numbers
from perception.errors import LabelError
from perception.geometry.se3 import inverse
from perception.types import Float64

_SHORT, _OBJECT, _TRACKING = 8, 15, 17


def _rows(text: Any) -> list[list[str]]:  # noqa: ANN401 - any content
    return [line.split() for line in text.splitlines()] if isinstance(text, str) else []


def _is_of(text: Any, *lengths: int) -> bool:  # noqa: ANN401 - any content
    rows = [row for row in _rows(text) if row]
    if not isinstance(text, str) or text.lstrip()[:1] in ("<", "{", "["):
        return False
    return not rows or any(len(row) in lengths for row in rows[:3])


def has_image_boxes(text: str) -> bool:
    """Return whether a row has a box in the image, as labels of a camera's view have."""
    rows = [row for row in _rows(text) if len(row) >= _OBJECT]
    edges = to_numbers([row[-11:-7] for row in rows if len(row) in (_OBJECT, _TRACKING)], 4)
    return bool((edges[:, 2] > edges[:, 0]).any())


def _read(path: Path, text: Any) -> Frames:  # noqa: ANN401 - a text
    frames: dict[str, list[LabelledBox]] = {}
    for number, row in enumerate(_rows(text), start=1):
        where = f"{path} row {number}"
        if not row:
            continue
        if len(row) == _SHORT:
            frame, track, kind = "", "", row[7]
            numbers = to_numbers([row[:7]], 7)[0]
        elif len(row) >= _OBJECT:
            head = 2 if row[0].lstrip("-").isdecimal() and len(row) >= _TRACKING else 0
            frame, track = (row[0], row[1]) if head else ("", "")
            kind = row[head]
            numbers = to_numbers([row[head + 8 : head + 15]], 7)[0][[3, 4, 5, 2, 1, 0, 6]]
        else:
            expected = f"{_SHORT}, {_OBJECT} or {_TRACKING} words"
            raise LabelError(where, expected=expected, found=str(len(row)))
        boxes = frames.setdefault(frame, [])
        if kind != DONT_CARE:
            has_track = track not in ("", "-1")
            boxes.append(
                LabelledBox(where, kind, track if has_track else "", tuple(numbers.tolist()))
            )
    return frames or {"": []}


def _from_camera(lidar_SE3_cam: Float64) -> Reading:
    """Return the reading of boxes in the frame of a camera, x right, y down and z forward."""

    def boxes(numbers: Float64) -> Float64:
        bottoms_m = numbers[:, :3] @ lidar_SE3_cam[:3, :3].T + lidar_SE3_cam[:3, 3]
        heading = -numbers[:, 6] - np.pi / 2
        return from_bottom(np.column_stack([bottoms_m, numbers[:, 3:6], heading]))

    return Reading("axes of a camera", boxes)


_READINGS = (
    Reading("axes of the scans, z of the centre", as_stated),
    Reading("axes of the scans, z of the bottom", from_bottom),
    # A camera without a calibration is taken to look ahead from where the LiDAR is.
    _from_camera(np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])),
)


def _row(box: LabelledBox) -> str:
    x, y, z, length, width, height, heading = box.numbers
    numbers = rounded((height, width, length, x, y, z, heading))
    kind = box.kind.replace(" ", "_")
    return f"{kind} 0 0 -10 -1 -1 -1 -1 {' '.join(f'{one:g}' for one in numbers)}\n"


def _write_frames(out: Path, frames: Sequence[LabelledFrame]) -> None:
    for frame in frames:
        write_document(out / f"{frame.name}.txt", "".join(map(_row, frame.boxes)))


def _write_tracking(out: Path, frames: Sequence[LabelledFrame]) -> None:
    rows = (
        f"{frame.number} {box.track or -1} {_row(box)}" for frame in frames for box in frame.boxes
    )
    write_document(out / "labels.txt", "".join(rows))


KITTI_FRAMES = LabelForm(
    "KITTI's rows a scan",
    lambda text: _is_of(text, _SHORT, _OBJECT, _OBJECT + 1),
    _read,
    _READINGS,
    _write_frames,
    is_per_scan=True,
)
KITTI_TRACKING = LabelForm(
    "KITTI's tracking rows",
    lambda text: _is_of(text, _TRACKING, _TRACKING + 1),
    _read,
    _READINGS,
    _write_tracking,
)


def with_camera(form: LabelForm, cam_SE3_lidar: Float64 | None) -> LabelForm:
    """Return a form with the calibration of the camera, in whose frame KITTI's rows may be.

    Args:
        form: Form of labels.
        cam_SE3_lidar: (4, 4) transform from the axes of the scans to the camera, or None.
    """
    if cam_SE3_lidar is None or form.readings is not _READINGS:
        return form
    return replace(form, readings=(_from_camera(inverse(cam_SE3_lidar)), *_READINGS[:2]))
