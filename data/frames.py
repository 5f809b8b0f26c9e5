"""Read the frames of a drive in order, one ahead of who uses them."""

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

from data.kitti.objects import ObjectFrames
from data.kitti.sequence import KittiSequence
from perception.errors import PerceptionError
from perception.types import Drive, Frame

log = logging.getLogger(__name__)

OnBadFrame = Literal["stop", "skip"]


def frame_count(drive: Drive, limit: int | None) -> int:
    """Return how many frames a drive has, or the limit where that is less."""
    return len(drive) if limit is None else min(limit, len(drive))


def file_number(drive: Drive, index: int) -> int:
    """Return the number by which the files of a frame are named."""
    if isinstance(drive, ObjectFrames):
        return drive.number(index)
    return drive.scans.numbers[index] if isinstance(drive, KittiSequence) else index


def read_frames(
    drive: Drive, *, on_bad_frame: OnBadFrame = "stop", limit: int | None = None, first: int = 0
) -> Iterator[Frame]:
    """Yield the frames of a drive in order, reading the next while this one is worked on.

    Args:
        drive: what to read.
        on_bad_frame: raise at a damaged or missing frame, or log one sentence and go on without it.
        limit: none from this many frames after the drive's start on.
        first: how many frames at the drive's start are passed over.

    Raises:
        PerceptionError: a frame cannot be read and `on_bad_frame` is "stop".
    """
    count = frame_count(drive, limit)
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="reader") as reader:
        ahead = reader.submit(drive.__getitem__, first) if first < count else None
        for index in range(first, count):
            assert ahead is not None
            current = ahead
            ahead = reader.submit(drive.__getitem__, index + 1) if index + 1 < count else None
            try:
                frame = current.result()
            except PerceptionError as error:
                if on_bad_frame == "stop":
                    raise
                log.warning("skipped frame %d: %s", index, error)
                continue
            yield frame
