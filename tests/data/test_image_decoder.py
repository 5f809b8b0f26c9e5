"""Images of every kind have the pixels that OpenCV finds; damaged ones are one sentence."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from data.image_decoder import decode_image
from perception.errors import ImageError
from tests.faults import fault

PIXELS = np.random.default_rng(0).integers(0, 256, (20, 31, 4)).astype(np.uint8)
DEEP = np.random.default_rng(1).integers(0, 1 << 16, (20, 31, 3)).astype(np.uint16)
RGB = Image.fromarray(PIXELS[..., :3])
TURNED = Image.Exif()
TURNED[0x0112] = 6  # to the right by 90 degrees


def by_opencv(suffix, pixels):
    return cv2.imencode(suffix, pixels)[1].tobytes()


def by_pillow(image, kind="PNG", **settings):
    file = io.BytesIO()
    image.save(file, kind, **settings)
    return file.getvalue()


KINDS = {
    "grey": by_opencv(".png", PIXELS[..., 0]),
    "grey of 16 bits": by_opencv(".png", DEEP[..., 0]),
    "colour of 16 bits": by_opencv(".png", DEEP),
    "alpha": by_opencv(".png", PIXELS),
    "grey with alpha": by_pillow(Image.fromarray(PIXELS).convert("LA")),
    "one bit": by_pillow(RGB.convert("1")),
    "palette": by_pillow(RGB.quantize(7)),
    "palette with a transparent colour": by_pillow(RGB.quantize(7), transparency=3),
    "turned PNG": by_pillow(RGB, exif=TURNED),
    "JPEG": by_opencv(".jpg", PIXELS[..., :3]),
    "grey JPEG": by_opencv(".jpg", PIXELS[..., 0]),
    "turned JPEG": by_pillow(RGB, "JPEG", exif=TURNED),
    "progressive JPEG": by_pillow(RGB, "JPEG", progressive=True),
    "TIFF": by_opencv(".tiff", PIXELS[..., :3]),
    "WebP": by_opencv(".webp", PIXELS[..., :3]),
    "BMP": by_opencv(".bmp", PIXELS[..., :3]),
}


@pytest.mark.parametrize("kind", KINDS)
def test_pixels_are_those_of_opencv(kind):
    data = KINDS[kind]
    expected = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    found = decode_image(data, "image")
    np.testing.assert_array_equal(found, expected)
    assert found.flags.writeable
    assert found.shape == ((31, 20, 3) if "turned" in kind else (20, 31, 3))


@pytest.mark.parametrize("kind", ["grey", "alpha", "palette", "JPEG", "TIFF"])
def test_an_image_that_is_cut_off_is_refused(kind):
    with fault(ImageError, where="image", found="that cannot be decoded"):
        decode_image(KINDS[kind][:-40], "image")
