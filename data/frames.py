"""Read the frames of a drive in order, the next one in the background."""

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from data.beam_pattern import beam_anomalies
from data.plausibility import describe_invalid_points
from data.recorded_drive import RecordedDrive
from perception.errors import PerceptionError
from perception.types import Drive, Frame, OnBadFrame

_STAMPS = 100  # that tell the period of the frames
_JITTER = 0.1  # of the period of a LiDAR, as a share
log = logging.getLogger(__name__)


def frame_count(drive: Drive, limit: int | None) -> int:
    """Return the number of frames of a drive, or the limit where that is less."""
    return len(drive) if limit is None else min(limit, len(drive))


def file_number(drive: Drive, index: int) -> int:
    """Return the frame number in KITTI's rows and file names; the index where names are others."""
    return drive.frame_numbers[index] if isinstance(drive, RecordedDrive) else index


def frame_name(drive: Drive, index: int) -> str:
    """Return the name of a frame in results; its number in six digits where no file has a name."""
    return drive.frame_names[index] if isinstance(drive, RecordedDrive) else f"{index:06d}"


def further_camera_names(drive: Drive) -> tuple[str, ...]:
    """Return the names of the cameras beside the main one."""
    if not isinstance(drive, RecordedDrive):
        return ()
    return tuple(one.name for one in drive.further_cameras.cameras)


def frame_period_s(drive: Drive) -> float:
    """Return the usual time from one frame to the next in seconds, that of a LiDAR revolution where it is near it.

    Frames are fewer than revolutions where a drive has only its key frames.
    """
    revolution_s = 1 / drive.sensor.rate_hz
    if not isinstance(drive, RecordedDrive) or not drive.is_sequence or len(drive) < 2:
        return revolution_s
    try:
        stamps_s = [drive.stamp_s(index) for index in range(min(len(drive), _STAMPS))]
    except PerceptionError:
        return revolution_s  # said where the frame is read
    period_s = float(np.median(np.diff(stamps_s)))
    is_near = abs(period_s / revolution_s - 1) < _JITTER or not 0 < period_s < np.inf
    return revolution_s if is_near else period_s


def clock_origin_ns(drive: Drive) -> int:
    """Return the time by the recording's clock at which stamps are 0, in nanoseconds; 0 where it is not known."""
    return drive.origin_ns if isinstance(drive, RecordedDrive) else 0


def read_frames(
    drive: Drive, *, on_bad_frame: OnBadFrame = "stop", limit: int | None = None, first: int = 0
) -> Iterator[Frame]:
    """Yield the frames of a drive in order, reading the next one in the background.

    What is odd about the drive, but no error, is logged once, with the first frame that shows it.

    Args:
        drive: Drive to read.
        on_bad_frame: Action at a damaged or missing frame: stop with an error, or log one sentence and skip the frame.
        limit: Number of frames from the start of the drive after which reading ends; None for all.
        first: Number of frames at the start of the drive that are not read.

    Raises:
        PerceptionError: A frame cannot be read and `on_bad_frame` is "stop".
    """
    frames = _read_ahead(drive, on_bad_frame, range(first, frame_count(drive, limit)))
    has_begun = has_invalid_points = False
    for frame in frames:
        if not has_begun:
            anomalies = (one.example for one in beam_anomalies(frame, drive.sensor))
            for sentence in (*drive.notes, *anomalies):
                log.warning("%s", sentence)
        if frame.invalid_points and not has_invalid_points:
            log.warning("%s", describe_invalid_points(frame))
        has_begun, has_invalid_points = True, has_invalid_points or frame.invalid_points > 0
        yield frame


def _read_ahead(drive: Drive, on_bad_frame: OnBadFrame, indices: range) -> Iterator[Frame]:
    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="reader") as reader:
        current = None
        for index in indices:
            current = current or reader.submit(drive.__getitem__, index)
            ahead = reader.submit(drive.__getitem__, index + 1) if index + 1 in indices else None
            try:
                frame = current.result()
            except PerceptionError as error:
                if on_bad_frame == "stop":
                    raise
                log.warning("skipped frame %d: %s", file_number(drive, index), error)
                continue
            finally:
                current = ahead
            yield frame
