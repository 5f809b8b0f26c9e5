"""Names by which the forms of labels are asked for; light to import."""

from typing import Literal

LabelFormName = Literal[
    "openlabel", "labelcloud", "sustechpoints", "kitti", "kitti-tracking", "datumaro", "tracklets", "supervisely",
    "nuscenes", "coco", "yolo",
]  # fmt: skip
