"""Words of `trifuse synth`: kinds of streets, folder layouts, and cameras of the synthetic vehicle."""

from typing import Literal, get_args

from perception.types import KittiLayout

# KITTI's layouts hold one camera; a folder with its drive.yaml any number.
SynthLayout = KittiLayout | Literal["folder"]
SYNTH_LAYOUTS: tuple[str, ...] = (*get_args(KittiLayout), "folder")
CameraName = Literal["front", "front_left", "front_right", "left", "right", "rear"]
StreetKind = Literal[
    "town", "housing", "main-road", "junction", "country",
    "industrial", "cycling", "shopping", "park", "jam", "field", "tunnel", "furnished",
]  # fmt: skip
