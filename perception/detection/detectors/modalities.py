"""The three modalities and the 8-bit input image of each (6.2.2).

    rgb   the camera's image                                          (H, W, 3)
    dm    depth of the LiDAR's returns, near 0, far 255 (6.2)          (H, W, 1)
    rm    their reflectance, 0..1 as 0..255 (B.2.1)                    (H, W, 1)

Unknown pixels of a map are 0.
"""

from collections.abc import Mapping

from perception.errors import ImageError
from perception.maps.densify import DenseMaps, dense_maps, densify
from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps, project_frame
from perception.types import Frame, MapFilling, MapModality, Modality, UInt8

CHANNELS: Mapping[Modality, int] = {"rgb": 3, "dm": 1, "rm": 1}
# Detectors of this package, by the names of their files without suffix.
SHIPPED_DETECTORS: Mapping[Modality, str] = {
    "rgb": "rgb_yolox",
    "dm": "dm_compact",
    "rm": "rm_compact",
}


def fill_maps(sparse: SparseMaps, filling: MapFilling = "default") -> DenseMaps:
    """Return the dense depth and reflectance maps by a filling: a method, or the returns alone (Table B.2)."""
    if filling == "sparse":
        return dense_maps(sparse, _leave_sparse)
    return densify(sparse, filling)


def map_image(dense: DenseMaps, modality: MapModality) -> UInt8:
    """Return the (H, W, 1) depth or reflectance map as 8-bit numbers, 0 where unknown."""
    image = dense.reflectance_image if modality == "rm" else dense.depth_image
    return image[..., None]


def camera_image(frame: Frame) -> UInt8:
    """Return the (H, W, 3) RGB image of a frame.

    Raises:
        ImageError: the frame has no image.
    """
    if frame.image is None:
        raise ImageError(frame.source, expected="a camera image", found="none")
    return frame.image


def modality_image(frame: Frame, modality: Modality, filling: MapFilling = "default") -> UInt8:
    """Return the (H, W, C) image of a frame for the detector of a modality.

    Raises:
        ImageError: the frame has no image, and the modality is rgb.
    """
    if modality == "rgb":
        return camera_image(frame)
    return map_image(fill_maps(project_frame(frame), filling), modality)


def _leave_sparse(sparse: SparseMaps) -> FilledMaps:
    return FilledMaps(sparse.scattered(sparse.depth_m), sparse.scattered(sparse.reflectance))
