"""Read the frames of a drive in order, the next one in the background."""

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

from data.kitti.objects import ObjectFrames
from data.kitti.sequence import KittiSequence
from perception.errors import PerceptionError
from perception.types import Drive, Frame, OnBadFrame

log = logging.getLogger(__name__)


def frame_count(drive: Drive, limit: int | None) -> int:
    """Return the number of frames of a drive, or the limit where that is less."""
    return len(drive) if limit is None else min(limit, len(drive))


def file_number(drive: Drive, index: int) -> int:
    """Return the number in the file names of a frame."""
    if isinstance(drive, ObjectFrames):
        return drive.number(index)
    return drive.scans.numbers[index] if isinstance(drive, KittiSequence) else index


def read_frames(
    drive: Drive, *, on_bad_frame: OnBadFrame = "stop", limit: int | None = None, first: int = 0
) -> Iterator[Frame]:
    """Yield the frames of a drive in order, reading the next one in the background.

    Args:
        drive: Drive to read.
        on_bad_frame: Action at a damaged or missing frame: stop with an error, or log one sentence and skip the frame.
        limit: Number of frames from the start of the drive after which reading ends; None for all.
        first: Number of frames at the start of the drive that are not read.

    Raises:
        PerceptionError: A frame cannot be read and `on_bad_frame` is "stop".
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
