"""Full scale of the reflectance in the scans of a drive, found once, so that it is the same for all of them."""

from dataclasses import dataclass

from data.kitti.sensor_files import FrameFiles, read_scan
from data.layouts import OpenConfig
from data.reflectance import full_scale, largest_reflectance, sample_indices, scale_note
from perception.errors import ScanError


@dataclass(frozen=True)
class ReflectanceScale:
    """Full scale of the reflectance of a drive.

    Attributes:
        scale: Full scale, 1 where reflectance is from 0 to 1.
        notes: Sentence that says so, where it was found and is not 1.
    """

    scale: float = 1.0
    notes: tuple[str, ...] = ()


def find_reflectance_scale(scans: FrameFiles, config: OpenConfig) -> ReflectanceScale:
    """Return the full scale that was asked for, else that of some scans of the drive."""
    if config.reflectance_scale is not None:
        return ReflectanceScale(config.reflectance_scale)
    readable = []
    for index in sample_indices(len(scans)):
        try:
            readable.append(read_scan(scans.paths[index]))
        except ScanError:
            continue  # reported when the frame is read
    largest = largest_reflectance(readable)
    scale = full_scale(largest)
    notes = () if scale == 1 else (scale_note(str(scans.folder), largest, scale),)
    return ReflectanceScale(scale, notes)
