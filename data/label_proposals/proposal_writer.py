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
from data.label_proposals.review_page import preview_of, write_review_page
from data.labelled_objects import box_owners
from data.recorded_drive import RecordedDrive
from data.results.result_writer import ResultWriter
from perception.geometry.boxes import transform_boxes
from perception.geometry.se3 import inverse
from perception.render.scene import SelectedObject
from perception.snapshot import Restorable
from perception.types import Boxes3D, Float64, Progress, Result, UInt8


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
        ProposalFile(proposals, self._poses).write(self._out)
        pictures = {one.number: self._preview(one) for one in proposals}
        write_review_page(self._out, self._drive.name, proposals, pictures)

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
        owners = box_owners(boxes, self._drive.scan(frame).points_velo)
        counts = np.bincount(owners[owners >= 0], minlength=len(present))
        for (one, _), count in zip(present, counts.tolist(), strict=True):
            one.points[frame] = count

    def _preview(self, one: Proposal) -> UInt8:
        row = int(one.points.argmax())
        frame = int(one.frames[row])
        box_world = one.boxes_world[row : row + 1]
        box_velo = transform_boxes(inverse(self._poses[frame]), box_world)
        return preview_of(self._drive.scan(frame).points_velo, box_velo)
