"""Proposals of labels of a drive, made when the pipeline has seen all of it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from data.label_proposals.observations import Observations
from data.label_proposals.proposals import (
    MIN_SCORE,
    ObservedObject,
    Proposal,
    ProposalFile,
    observed_objects,
    to_proposals,
)
from data.label_proposals.review_page import preview, write_review_page
from data.recorded_drive import RecordedDrive
from data.results.result_writer import ResultWriter
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.kernels.box_owners import owners_in_boxes
from perception.render.scene import SelectedObject
from perception.snapshot import Restorable
from perception.types import Boxes3D, Float64, Progress, Result, UInt8

# Of the boxes whose returns are counted, and of the cells on the ground by which they are.
_REACH_M, _CELL_M, _MARGIN_M = 100.0, 0.1, 0.1
_GROUND_M = 0.15  # above a box's bottom, below which returns may be of the ground


class ProposalWriter(Restorable, ResultWriter):
    """Writes proposals and a page to review them at the end of a run."""

    memories = ("_observations", "_poses", "_stamps_s")

    def __init__(self, out: Path, drive: RecordedDrive, progress: Progress = iter) -> None:
        """Write nothing yet.

        Args:
            out: Folder of the results.
            drive: Drive of the run.
            progress: Progress bar over the frames whose returns are counted.
        """
        self._out, self._drive, self._progress = out, drive, progress
        self._observations: list[Observations] = []
        self._poses: dict[int, Float64] = {}
        self._stamps_s: list[float] = []

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add what was found in one frame."""
        self._observations.append(Observations.of_result(result, MIN_SCORE))
        self._poses[result.frame.index] = result.world_SE3_velo
        self._stamps_s.append(result.frame.stamp_s)

    def close(self, *, is_complete: bool) -> None:
        """Write both files, unless the run has stopped early."""
        if not is_complete:
            return
        frames = np.array(list(self._poses), np.int64)
        observations = Observations.concatenate(self._observations)
        found = observed_objects(observations, frames, np.array(self._stamps_s))
        for frame in self._progress(frames.tolist()):
            self._count_returns(found, frame)
        proposals = to_proposals(found)
        names = {frame: self._drive.frame_names[frame] for frame in self._poses}
        ProposalFile(proposals, self._poses, names).write(self._out)
        write_review_page(self._out, self._drive.name, proposals, self._previews(proposals))

    def _count_returns(self, found: Sequence[ObservedObject], frame: int) -> None:
        """Count the returns in the boxes of one frame."""
        rows = [np.searchsorted(one.trajectory.frames, frame) for one in found]
        present = [
            (one, one.trajectory.boxes_world[row : row + 1])
            for one, row in zip(found, rows, strict=True)
            if row < len(one.trajectory.frames) and one.trajectory.frames[row] == frame
        ]
        boxes_world = Boxes3D.concatenate(box for _, box in present)
        boxes = transform_boxes(inverse(self._poses[frame]), boxes_world)
        is_near = np.abs(boxes.bottom_m[:, :2]).max(axis=1) < _REACH_M
        # A return in two boxes is one of the smaller.
        order = np.argsort(np.where(is_near, boxes.size_m.prod(axis=1), np.inf))[: is_near.sum()]
        columns = np.column_stack([boxes.bottom_m, boxes.size_m, boxes.yaw_rad])[order]
        points = np.ascontiguousarray(self._drive.scan(frame).points_velo)
        owners = owners_in_boxes(
            points, np.ascontiguousarray(columns), _CELL_M, _MARGIN_M, _GROUND_M
        )
        counts = np.bincount(owners[owners >= 0], minlength=len(order))
        for row, count in zip(order.tolist(), counts.tolist(), strict=True):
            present[row][0].points[frame] = count

    def _previews(self, proposals: Sequence[Proposal]) -> dict[int, UInt8]:
        """Return an image of each object by its number, in the frame with the most of its returns."""
        of_frame: dict[int, list[Proposal]] = {}
        for one in proposals:
            of_frame.setdefault(int(one.frames[one.points.argmax()]), []).append(one)
        previews = {}
        for index in self._progress(sorted(of_frame)):
            frame, velo_SE3_world = self._drive[index], inverse(self._poses[index])
            for one in of_frame[index]:
                row = int(one.points.argmax())
                box_world = one.boxes_world[row : row + 1]
                previews[one.number] = preview(frame, transform_boxes(velo_SE3_world, box_world))
        return previews
