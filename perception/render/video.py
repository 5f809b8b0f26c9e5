"""Videos as H.264 files that every player and browser opens."""

import logging
from contextlib import AbstractContextManager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import av
import cv2
import numpy as np
from av.container import OutputContainer

from perception.atomic_file import writing
from perception.errors import ImageError
from perception.types import UInt8

_LOG = logging.getLogger(__name__)
# In order of preference. Every build of FFmpeg has the last one, but browsers do not play it.
_ENCODERS = ("libx264", "libopenh264", "mpeg4")
# Encodes in a quarter of the time of `veryfast`, into a file about 1.6 times as large.
# A constant quantizer needs no look at frames ahead: a ninth less time than `crf` 24, at the same quality.
_X264_OPTIONS = {"preset": "ultrafast", "qp": "25", "threads": "1"}
# From colour differences that span 0 to 255, as of images, to those of videos, 16 to 240.
_STUDIO_SWING = np.rint(128 + (np.arange(256) - 128) * 224 / 255).astype(np.uint8)
_MPEG4_BITS_PER_PIXEL = 2
# First libavformat whose files can be read at any moment while they are written.
_HYBRID_SINCE = (61, 7)


class ImageSink(AbstractContextManager["ImageSink"], Protocol):
    """Writer of a sequence of images."""

    def add(self, image: UInt8) -> None:
        """Add the next (H, W, 3) RGB image."""
        ...


class NullVideoWriter:
    """Writer that drops all images; implements `ImageSink`."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None: ...

    def add(self, image: UInt8) -> None:
        """Drop the image."""


class VideoWriter:
    """Writer of an MP4 file; implements `ImageSink`.

    The file has the name `partial_path` until it is complete; where a run stops early, that file plays all images
    so far. Without images no file is written.
    """

    def __init__(self, path: Path, rate_hz: float = 10.0) -> None:
        """Start without a file.

        Args:
            path: Path of the complete file.
            rate_hz: Images per second.
        """
        self.path = path
        self.partial_path = path.with_name(f"{path.stem}.partial.mp4")
        self._rate_hz = Fraction(rate_hz).limit_denominator(1001)
        self._container: OutputContainer | None = None
        self._stream: Any = None
        self._planes: UInt8 | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close(is_complete=error is None)

    def close(self, *, is_complete: bool) -> None:
        """Close the file, and give it its final name where it is complete.

        Raises:
            WriteError: The file cannot be written.
        """
        container, self._container = self._container, None
        if container is None:
            return
        with writing(self.path):
            with container:
                for packet in self._stream.encode():
                    container.mux(packet)
            if is_complete:
                self.partial_path.replace(self.path)

    def add(self, image: UInt8) -> None:
        """Encode the next (H, W, 3) RGB image; height and width are even and constant.

        Raises:
            ImageError: The image differs in size from the first, or has an odd size.
            WriteError: The file cannot be written.
        """
        with writing(self.path):
            container = self._container or self._open(image)
            self._check_size(image)
            self._planes = planes = _to_yuv420(image, self._planes)
            frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
            for packet in self._stream.encode(frame):
                container.mux(packet)

    def _open(self, image: UInt8) -> OutputContainer:
        height, width = image.shape[:2]
        if height % 2 or width % 2:
            raise ImageError(
                self.path,
                expected="images of even width and height",
                found=f"{width}x{height} pixels",
            )
        encoder = _best_encoder()
        flags = "faststart"
        if av.library_versions["libavformat"][:2] >= _HYBRID_SINCE:
            flags = "hybrid_fragmented"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        container = av.open(str(self.partial_path), "w", format="mp4", options={"movflags": flags})
        self._stream = container.add_stream(encoder, rate=self._rate_hz)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = "yuv420p"
        if encoder == "libx264":
            self._stream.options = _X264_OPTIONS
        else:
            self._stream.bit_rate = _MPEG4_BITS_PER_PIXEL * width * height
        self._container = container
        return container

    def _check_size(self, image: UInt8) -> None:
        expected = (self._stream.height, self._stream.width, 3)
        if image.shape != expected:
            raise ImageError(
                self.path, expected=f"images of shape {expected}", found=f"{image.shape}"
            )


def _to_yuv420(image: UInt8, planes: UInt8 | None) -> UInt8:
    """Return the (H * 3 / 2, W) luma, then blue and red differences of each four pixels (BT.601), in given memory.

    OpenCV takes the differences of one of the four pixels, which breaks coloured lines; here they are those of the
    mean. FFmpeg does the same in several times the time.
    """
    height, width = image.shape[:2]
    planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420, dst=planes), np.uint8)
    means = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    differences = cv2.cvtColor(means, cv2.COLOR_RGB2YCrCb)
    for plane, channel in zip(
        planes[height:].reshape(2, height // 2, width // 2), (2, 1), strict=True
    ):
        cv2.LUT(cv2.extractChannel(differences, channel), _STUDIO_SWING, dst=plane)
    return planes


def open_video(path: Path | None, rate_hz: float = 10.0) -> ImageSink:
    """Return the writer of a file, or one that drops all images where there is no path."""
    return NullVideoWriter() if path is None else VideoWriter(path, rate_hz)


def _best_encoder() -> str:
    encoder = next(name for name in _ENCODERS if name in av.codecs_available)
    if encoder == "mpeg4":
        _LOG.warning("This build of PyAV has no H.264 encoder: the video is MPEG-4 Part 2.")
    return encoder
