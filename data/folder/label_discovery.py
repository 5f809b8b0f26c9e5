"""Where the labels of a drive lie in a folder, by their names and their content."""

import re
from collections.abc import Iterator
from pathlib import Path

from data.box_labels.boxes import LabelForm
from data.box_labels.forms import find_form
from data.folder.discovery import folders_below
from data.kitti.sensor_files import list_folder
from perception.errors import LabelError

_NAMES = re.compile(r"(label|annot|tracklet|openlabel|sample_annotation)", re.I)


def find_labels(root: Path, scans: Path) -> tuple[Path, LabelForm] | None:
    """Return the labels beside the scans, or among them, with their form; None without any.

    Args:
        root: Folder of the drive.
        scans: Folder of the scans.
    """
    for path in _label_paths(root, scans):
        try:
            form = find_form(path)
        except LabelError:  # it is met where drive.yaml names it
            continue
        if form is not None and (form.is_per_scan or path != scans):
            return path, form
    return None


def _label_paths(root: Path, scans: Path) -> Iterator[Path]:
    for folder in folders_below(root):
        if folder != scans:
            yield from (path for path in sorted(list_folder(folder)) if _NAMES.match(path.name))
    yield scans
