"""Pictures of results as files."""

from pathlib import Path

import cv2

from data.atomic_file import write_atomically
from perception.types import UInt8


def write_jpeg(path: Path, image: UInt8, quality: int = 90) -> None:
    """Write an (H, W, 3) RGB picture whole or not at all."""
    _, encoded = cv2.imencode(".jpg", image[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, quality))
    write_atomically(path, encoded.tobytes())
