"""The image of each scan: by its name, or by its time where names of one number are of other times.

The synchronised recordings of KITTI name scan and image of a frame alike. In others each sensor counts for itself, at its
own rate, and only the timestamps say what belongs together.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data.kitti.sensor_files import FrameFiles, join_notes
from data.kitti.timestamps import Times, first_known, seconds_since
from data.nearest_time import NONE, half_period_s, nearest_in_time


@dataclass(frozen=True)
class JoinedImages:
    """Images of a drive by scan.

    Attributes:
        paths: (F) image of each scan, None for a scan that no image is near; None where no scan has an image.
        notes: Sentences on images that are not joined by their names.
    """

    paths: tuple[Path | None, ...] | None
    notes: tuple[str, ...]


def join_images(
    scans: FrameFiles,
    images: FrameFiles,
    scan_times: Times | None = None,
    image_times: Times | None = None,
) -> JoinedImages:
    """Join images to scans by name, or by the nearest time where the times contradict the names.

    Args:
        scans: Scans of the drive.
        images: Images of one camera.
        scan_times: (F,) times of the scans, or None.
        image_times: (K,) times of the images, or None.
    """
    by_name = images.joined(scans)
    if len(images) and scan_times is not None and image_times is not None:
        joined = _join_by_time(scans, images, (scan_times, image_times), by_name)
        if joined is not None:
            return joined
    paths = None if by_name is None else by_name.paths
    return JoinedImages(paths, join_notes(scans, {"images": images}))


def _join_by_time(
    scans: FrameFiles, images: FrameFiles, times: tuple[Times, Times], by_name: FrameFiles | None
) -> JoinedImages | None:
    """Return the images by time, or None where that tells nothing, or the names say the same."""
    origin = first_known(times[0])
    scans_s, images_s = (seconds_since(one, origin) for one in times)
    if by_name is not None:
        stamp_of = dict(zip(images.paths, images_s.tolist(), strict=True))
        named_s = np.array([stamp_of.get(path, np.nan) for path in by_name.paths])
        # Comparisons with NaN are false: an unknown time contradicts nothing.
        if not (np.abs(named_s - scans_s) > half_period_s(scans_s)).any():
            return None
    nearest = nearest_in_time(scans_s, images_s)
    if (nearest == NONE).all():
        return None
    found = int((nearest != NONE).sum())
    note = (
        f"{images.folder}: {len(images)} images are joined to the scans by their times, as numbers in names are of other "
        f"times; {found} of {len(scans)} scans have one"
    )
    paths = tuple(None if index == NONE else images.paths[index] for index in nearest.tolist())
    return JoinedImages(paths, (note,))
