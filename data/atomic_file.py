"""Atomic file writing: a file is complete or absent."""

from pathlib import Path

import cv2

from perception.types import UInt8


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file under another name and rename it; make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    part.write_bytes(data)
    part.replace(path)


def write_jpeg(path: Path, image: UInt8, quality: int = 90) -> None:
    """Write an (H, W, 3) RGB image atomically as JPEG."""
    _, encoded = cv2.imencode(".jpg", image[:, :, ::-1], (cv2.IMWRITE_JPEG_QUALITY, quality))
    write_atomically(path, encoded.tobytes())
