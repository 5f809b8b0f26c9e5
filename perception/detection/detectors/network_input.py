"""From an image of a modality to the network's input: JPEG compression where it was trained with one, then the size.

The thesis compares modalities by images of one JPEG quality (7.2.2). A network that was trained on compressed images
states their quality, and runs on images of the same quality.
"""

import cv2
import numpy as np

from perception.detection.detectors.input_size import InputSize, stretch
from perception.types import Modality, UInt8


def prepare_image(
    image: UInt8, modality: Modality, size: InputSize, jpeg_quality: int | None = None
) -> UInt8:
    """Return an (H, W, C) image as the (h, w, C) input of a network.

    Args:
        image: Camera image or map.
        modality: Modality of the image.
        size: Size of the input.
        jpeg_quality: Quality of the JPEG compression, 1 to 100; None for none.
    """
    if jpeg_quality is not None:
        image = jpeg_compressed(image, jpeg_quality)
    return stretch(image, size, modality)


def jpeg_compressed(image: UInt8, quality: int) -> UInt8:
    """Return an (H, W, C) image after JPEG compression of a quality, 1 to 100."""
    # OpenCV takes BGR; the order matters, as JPEG keeps brightness better than colour.
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    return np.asarray(decoded, np.uint8).reshape(image.shape)[..., ::-1]
