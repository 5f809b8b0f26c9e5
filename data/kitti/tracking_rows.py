"""Rows of KITTI's tracking benchmark as plain numbers, read and written; they need no calibration.

Labels have 17 columns, results of a tracker an 18th:

    frame id type truncation occlusion alpha  x1 y1 x2 y2  height width length  x y z  ry  [score]

    0 2 Pedestrian 0 0 -2.523309 1106.137292 166.576807 1204.470628 323.876144 1.71 0.55 1.09 ...
    0 7 Car -1 -1 -10 296.74 161.75 455.22 292.37 -1 -1 -1 -1000 -1000 -1000 -10 0.93

Frames count from 0. What a tracker does not say is -1 (truncation, occlusion, size), -1000 (place) or
-10 (angle). A row whose id is below 0 belongs to no track; regions without labels are of type DontCare.
All is as in the file: pixels, metres and radians, x y z the centre of the bottom face in the rectified
camera, ry the heading about its y axis.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from data.kitti.mot_rows import are_mot_rows, read_mot_rows
from data.kitti.reading import first_row
from data.kitti.rows import ObjectRows, read_object_rows
from perception.errors import LabelError
from perception.evaluation.multi_object.kitti_protocol import ImageBoxes
from perception.types import ArrayTable, Bool, Float64, Int

TYPES = (
    *("Car", "Van", "Truck", "Tram", "Misc", "Cyclist"),
    *("Pedestrian", "Person", "Person_sitting", "DontCare"),
)
NO_TYPE = ""  # of rows that state no class, as those of MOTChallenge


@dataclass(frozen=True)
class TrackingRows(ArrayTable):
    """N rows of one sequence.

    Attributes:
        frames: (N,) frame numbers, from 0.
        ids: (N,) ids of objects or tracks, below 0 where there is none.
        types: (N,) class names, each one of `TYPES`, upper or lower case; `NO_TYPE` of rows that state none.
        truncation: (N,) truncation levels 0, 1, 2; -1 unknown.
        occlusion: (N,) occlusion levels 0, 1, 2, 3; -1 unknown.
        alphas_rad: (N,) headings as seen from the camera (alpha); -10 unknown.
        boxes_px: (N, 4) image boxes x1 y1 x2 y2.
        sizes_hwl_m: (N, 3) height, width, length; -1 unknown.
        bottoms_cam_m: (N, 3) bottom centres, x right, y down, z forward; -1000 unknown.
        headings_rad: (N,) headings ry; -10 unknown.
        scores: (N,) scores; NaN in labels, which have none.
    """

    frames: Int
    ids: Int
    types: np.ndarray
    truncation: Float64
    occlusion: Float64
    alphas_rad: Float64
    boxes_px: Annotated[Float64, 4]
    sizes_hwl_m: Annotated[Float64, 3]
    bottoms_cam_m: Annotated[Float64, 3]
    headings_rad: Float64
    scores: Float64

    @property
    def image_boxes(self) -> ImageBoxes:
        """Columns that KITTI's 2D protocol reads."""
        return ImageBoxes(
            self.frames, self.ids, self.types, self.truncation, self.occlusion, self.boxes_px
        )


def read_label_rows(path: Path, frame_count: int | None = None) -> TrackingRows:
    """Read the labels of a sequence.

    Args:
        path: Label file of a sequence.
        frame_count: Number of frames of the sequence, where it is known; no row may be of a later frame.

    Raises:
        LabelError: The file or a row cannot be read, a class or a frame number is not one that the
            benchmark knows, or an id of one type is twice in a frame.
    """
    table = read_object_rows([path], heads=2)
    return _checked(_to_rows(table, np.full(len(table), np.nan)), path, frame_count)


def read_result_rows(path: Path, frame_count: int | None = None) -> TrackingRows:
    """Read the results of a tracker for a sequence, in KITTI's columns or MOTChallenge's; an empty file has no tracks.

    Raises:
        LabelError: The same faults as for `read_label_rows`.
    """
    if are_mot_rows(first_row(path)):
        return _checked(_of_mot_rows(read_mot_rows(path)), path, frame_count, first_frame=1)
    table = read_object_rows([path], heads=2, has_scores=True)
    return _checked(_to_rows(table, table.numbers[:, -1]), path, frame_count)


def format_result_rows(rows: TrackingRows) -> str:
    """Return rows of 18 columns, the last the score, each with its line end."""
    lines = zip(_format_lines(rows), rows.scores.tolist(), strict=True)
    return "".join(f"{line} {score:.6f}\n" for line, score in lines)


def _to_rows(table: ObjectRows, scores: Float64) -> TrackingRows:
    return TrackingRows(
        frames=table.heads[:, 0],
        ids=table.heads[:, 1],
        types=table.types,
        truncation=table.numbers[:, 0],
        occlusion=table.numbers[:, 1],
        alphas_rad=table.numbers[:, 2],
        boxes_px=table.numbers[:, 3:7],
        sizes_hwl_m=table.numbers[:, 7:10],
        bottoms_cam_m=table.numbers[:, 10:13],
        headings_rad=table.numbers[:, 13],
        scores=scores,
    )


def _of_mot_rows(numbers: Float64) -> TrackingRows:
    """Return rows whose frames count from 0, from (N, 7) numbers of MOTChallenge's columns."""
    unknown = np.full(len(numbers), -1.0)
    return TrackingRows(
        frames=numbers[:, 0].astype(np.int64) - 1,
        ids=numbers[:, 1].astype(np.int64),
        types=np.full(len(numbers), NO_TYPE),
        truncation=unknown,
        occlusion=unknown,
        alphas_rad=10 * unknown,
        boxes_px=np.hstack([numbers[:, 2:4], numbers[:, 2:4] + numbers[:, 4:6]]),
        sizes_hwl_m=np.full((len(numbers), 3), -1.0),
        bottoms_cam_m=np.full((len(numbers), 3), -1000.0),
        headings_rad=10 * unknown,
        scores=numbers[:, 6],
    )


def _checked(
    rows: TrackingRows, path: Path, frame_count: int | None, first_frame: int = 0
) -> TrackingRows:
    """Return the rows after validating them by the rules of the benchmark; errors count frames as the file does."""
    types = np.char.lower(rows.types)
    is_unknown = ~np.isin(types, [NO_TYPE, *(name.lower() for name in TYPES)])
    if is_unknown.any():
        raise _row_error(path, is_unknown, f"one of {', '.join(TYPES)}", rows.types)
    is_beyond = rows.frames < 0
    if frame_count is not None:
        is_beyond |= rows.frames >= frame_count
    if is_beyond.any():
        last = "" if frame_count is None else f" to {frame_count - 1 + first_frame}"
        expected = f"frames from {first_frame}{last}"
        raise _row_error(path, is_beyond, expected, rows.frames + first_frame)
    is_repeated = _is_repeated(rows, types)
    if is_repeated.any():
        where = int(is_repeated.argmax())
        found = f"id {rows.ids[where]} again in frame {rows.frames[where] + first_frame}"
        expected = f"every {rows.types[where] or 'id'} once in a frame"
        raise LabelError(f"{path} row {where + 1}", expected=expected, found=found)
    return rows


def _is_repeated(rows: TrackingRows, types: np.ndarray) -> Bool:
    """Return an (N,) mask of the rows that repeat the frame, type and id of an earlier row."""
    # The last row of each kind is what a dictionary keeps: walked backwards, that is the first.
    keys = list(zip(rows.frames.tolist(), types.tolist(), rows.ids.tolist(), strict=True))
    first = {key: row for row, key in reversed(list(enumerate(keys)))}
    is_first = np.zeros(len(keys), bool)
    is_first[list(first.values())] = True
    return np.asarray(~is_first & (rows.ids >= 0))


def _row_error(path: Path, is_bad: Bool, expected: str, values: np.ndarray) -> LabelError:
    """Return an error that names the first bad row and its value."""
    row, *column = np.argwhere(is_bad)[0].tolist()
    found = repr(str(values[(row, *column)]))
    return LabelError(f"{path} row {row + 1}", expected=expected, found=found)


def _format_lines(rows: TrackingRows) -> list[str]:
    heads = (rows.frames, rows.ids, rows.types, rows.truncation, rows.occlusion)
    numbers = np.column_stack(
        [rows.alphas_rad, rows.boxes_px, rows.sizes_hwl_m, rows.bottoms_cam_m, rows.headings_rad]
    )
    # Numbers of Python: those of NumPy take several times as long to format.
    line = " ".join(["{} {} {} {:g} {:g}", *["{:.6f}"] * numbers.shape[1]]).format
    columns = zip(*(head.tolist() for head in heads), numbers.tolist(), strict=True)
    return [line(*head, *row) for *head, row in columns]
