"""The forms of labels that are read, and which of them a file or a folder is of."""

from collections.abc import Mapping
from pathlib import Path

from data.box_labels.boxes import LabelForm, read_content
from data.box_labels.datumaro import DATUMARO
from data.box_labels.form_names import LabelFormName
from data.box_labels.image_boxes import COCO, YOLO
from data.box_labels.kitti_rows import KITTI_FRAMES, KITTI_TRACKING, has_image_boxes
from data.box_labels.labelcloud import LABELCLOUD
from data.box_labels.nuscenes_tables import NUSCENES_TABLES, TABLES
from data.box_labels.openlabel import OPENLABEL
from data.box_labels.supervisely import SUPERVISELY
from data.box_labels.sustechpoints import SUSTECHPOINTS
from data.box_labels.tracklets import TRACKLETS
from data.kitti.sensor_files import FrameFiles
from perception.errors import LabelError

FORM_OF_NAME: Mapping[LabelFormName, LabelForm] = {
    "labelcloud": LABELCLOUD,
    "sustechpoints": SUSTECHPOINTS,
    "yolo": YOLO,
    "kitti": KITTI_FRAMES,
    "kitti-tracking": KITTI_TRACKING,
    "openlabel": OPENLABEL,
    "datumaro": DATUMARO,
    "tracklets": TRACKLETS,
    "supervisely": SUPERVISELY,
    "nuscenes": NUSCENES_TABLES,
    "coco": COCO,
}
FORMS = tuple(FORM_OF_NAME.values())
_SUFFIXES = (".json", ".txt", ".xml")
# Files that tools write beside their labels.
_BESIDE = {
    "classes.txt", "frame_list.txt", "frame_pointcloud_map.json", "key_id_map.json", "meta.json",
    *(f"{name}.json" for name in TABLES),
}  # fmt: skip


def label_files(path: Path) -> FrameFiles:
    """List the files of labels at a path: itself, or those in it."""
    if path.is_file():
        return FrameFiles(path.parent, (path,))
    files = FrameFiles.within(path, _SUFFIXES)
    is_label = (one.name not in _BESIDE and not one.name.startswith("_") for one in files.paths)
    return FrameFiles(path, tuple(p for p, kept in zip(files.paths, is_label, strict=True) if kept))


def find_form(path: Path) -> LabelForm | None:
    """Return the form of the labels at a path, by the largest file; None where it is of none.

    Raises:
        LabelError: The file cannot be read.
    """
    files = label_files(path).paths
    if not files:
        return None
    content = read_content(max(files, key=lambda one: one.stat().st_size))
    return next((form for form in FORMS if form.is_of(content)), None)


def require_form(path: Path) -> LabelForm:
    """Return the form of the labels at a path.

    Raises:
        LabelError: They are of none, or cannot be read.
    """
    form = find_form(path)
    if form is None:
        expected = f"labels of {', '.join(one.name for one in FORMS)}"
        raise LabelError(path, expected=expected, found="another content")
    return form


def is_in_view(form: LabelForm, path: Path) -> bool:
    """Return whether labels of a form at a path are KITTI's of a camera's view: rows with boxes in the image.

    Raises:
        LabelError: The file cannot be read.
    """
    if form not in (KITTI_FRAMES, KITTI_TRACKING):
        return False
    texts = (read_content(one) for one in label_files(path).paths)
    return any(map(has_image_boxes, texts))
