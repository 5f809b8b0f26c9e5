"""Files of dense maps, as `trifuse maps` writes them."""

from pathlib import Path

import cv2

from perception.atomic_file import write_atomically
from perception.maps.densify import DenseMaps
from perception.maps.encoding import encode_depth, encode_reflectance


def write_maps(dense: DenseMaps, folder: Path, name: str) -> None:
    """Write both maps as 8-bit PNG into the folders `depth` and `reflectance`.

    Args:
        dense: Depth and reflectance map.
        folder: Folder of both.
        name: Name of the two files.
    """
    images = {
        "depth": encode_depth(dense.depth_m),
        "reflectance": encode_reflectance(dense.reflectance),
    }
    for kind, image in images.items():
        _, encoded = cv2.imencode(".png", image)
        write_atomically(folder / kind / name, encoded.tobytes())
