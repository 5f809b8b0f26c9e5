"""One part of the search: what the settings that share a ground removal reach in one chunk of frames."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from perception.detection.config import ProposalConfig
from perception.detection.depthcn.above_ground import find_above_ground
from perception.detection.depthcn.proposals import cluster_points, fit_boxes
from perception.errors import PerceptionError
from perception.evaluation.detection.proposal_recall import count_recalled
from perception.maps.projection import camera_of
from perception.types import Drive, Frame, Labels, Method, OnBadFrame
from train.proposal_search.survey import FrameSet, is_of_class


@dataclass(frozen=True)
class SearchTask:
    """Frames and parameters that one process counts at a time.

    Attributes:
        chunk: Number of the chunk.
        frames: Frames of the chunk.
        parameters: Parameters with the same cell and minimum variance.
        method: Method of the proposals: default or thesis.
        of_class: Class of the objects.
        overlaps: IoUs from which on a proposal reaches an object.
        on_bad_frame: Raise at a damaged frame, or count it as unread.
    """

    chunk: int
    frames: FrameSet
    parameters: tuple[ProposalConfig, ...]
    method: Method
    of_class: str
    overlaps: tuple[float, ...]
    on_bad_frame: OnBadFrame = "stop"


@dataclass(frozen=True)
class ProposalCount:
    """Counts of one setting in one chunk, or in several together.

    Attributes:
        parameters: Parameters of the proposals.
        frames: Number of frames that were read.
        unread: Number of frames that could not be read.
        objects: Number of objects of the class in the frames that were read.
        reached: Number of objects reached at each IoU.
        proposals: Number of proposals of all frames.
    """

    parameters: ProposalConfig
    frames: int
    unread: int
    objects: int
    reached: tuple[int, ...]
    proposals: int

    def __add__(self, other: "ProposalCount") -> "ProposalCount":
        """Put two chunks together."""
        return ProposalCount(
            self.parameters,
            self.frames + other.frames,
            self.unread + other.unread,
            self.objects + other.objects,
            tuple(a + b for a, b in zip(self.reached, other.reached, strict=True)),
            self.proposals + other.proposals,
        )


def run_search_task(part: SearchTask) -> list[ProposalCount]:
    """Read each frame of a part once, and add up what every setting reaches in it.

    Raises:
        PerceptionError: a frame cannot be read, or has no camera.
    """
    drive = part.frames.open()
    none = (0,) * len(part.overlaps)
    sums = [ProposalCount(parameters, 0, 0, 0, none, 0) for parameters in part.parameters]
    for index in part.frames.frames:
        frame = read_or_skip(drive, index, part.on_bad_frame)
        if frame is None:
            sums = [replace(one, unread=one.unread + 1) for one in sums]
            continue
        counts = _count_frame(frame, drive.labels(index), part)
        sums = [one + count for one, count in zip(sums, counts, strict=True)]
    return sums


def read_or_skip(drive: Drive, index: int, on_bad_frame: OnBadFrame) -> Frame | None:
    """Read a frame, or return None where it cannot be read and need not be."""
    try:
        return drive[index]
    except PerceptionError:
        if on_bad_frame == "stop":
            raise
        return None


def _count_frame(frame: Frame, labels: Labels, part: SearchTask) -> Iterator[ProposalCount]:
    """Yield what each setting reaches; the ground, which all have in common, is removed once."""
    objects_px = labels.boxes_px[is_of_class(labels, part.of_class)]
    above_ground = find_above_ground(
        frame.points_velo,
        *camera_of(frame),
        part.parameters[0].cell_m,
        part.parameters[0].min_variance_m2,
        part.method,
    )
    for parameters in part.parameters:
        labels_of_points = cluster_points(
            above_ground, parameters.radius_m, parameters.min_points, part.method
        )
        found = fit_boxes(above_ground, labels_of_points)
        reached = count_recalled(objects_px, found.boxes_px, part.overlaps)
        yield ProposalCount(parameters, 1, 0, len(objects_px), tuple(reached.tolist()), len(found))
