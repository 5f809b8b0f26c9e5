"""Videos as H.264 files that every player and browser opens."""

import logging
from collections import deque
from contextlib import AbstractContextManager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self

import av
import cv2
import numpy as np
from av.container import InputContainer, OutputContainer

from perception.atomic_file import part_of, writing
from perception.errors import ImageError
from perception.snapshot import NotStorableError, Restorable
from perception.types import UInt8

_LOG = logging.getLogger(__name__)
# In order of preference. Every build of FFmpeg has the last one, but browsers do not play it.
_ENCODERS = ("libx264", "libopenh264", "mpeg4")
# Encodes in a quarter of the time of `veryfast`, into a file about 1.6 times as large.
# A constant quantizer needs no look at frames ahead: a ninth less time than `crf` 24, at the same quality.
_X264_OPTIONS = {"preset": "ultrafast", "qp": "25", "threads": "1", "forced-idr": "1"}
# With these options, it holds no image back, and an image that starts a segment depends on none before it.
_RESUMABLE = "libx264"
# Images that FFmpeg has not written yet: a fragment is written when the next one begins.
_UNWRITTEN = 2
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


class VideoWriter(Restorable):
    """Writer of an MP4 file; implements `ImageSink`.

    The file has the name `partial_path` until it is complete; where a run stops early, that file plays all images
    so far. Without images no file is written.
    """

    memories = ("_images", "_newest", "_starts_segment")

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
        self._images = 0
        self._newest: deque[tuple[bytes, bool]] = deque(maxlen=_UNWRITTEN)
        self._starts_segment = False

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
            container = self._container or self._open(image.shape[:2], self.partial_path)
            self._check_size(image)
            self._planes = planes = _to_yuv420(image, self._planes)
            frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
            if self._starts_segment:  # as after `restore`, where the encoder knows no image before
                frame.pict_type = av.video.frame.PictureType.I
                self._starts_segment = False
            frame.pts, frame.time_base = self._images, 1 / self._rate_hz
            self._images += 1
            for packet in self._stream.encode(frame):
                self._newest.append((bytes(packet), packet.is_keyframe))
                container.mux(packet)

    def snapshot(self) -> bytes:
        """Return what a new writer needs to go on with the partial file; the next image needs none before it.

        Raises:
            NotStorableError: The encoder holds images back, or keeps a state that shows in later ones.
        """
        self._starts_segment = True
        if self._container is not None and self._stream.codec.name != _RESUMABLE:
            raise NotStorableError(f"a video by {self._stream.codec.name}")
        return super().snapshot()

    def restore(self, snapshot: bytes) -> None:
        """Go on from a snapshot: take over the images so far from the partial file, which a killed process has left.

        Raises:
            ImageError: The partial file is gone, damaged, or has fewer images.
        """
        super().restore(snapshot)
        if not self._images:
            return
        earlier = self.partial_path if self.partial_path.is_file() else self.path
        copy = part_of(self.partial_path)
        try:
            with av.open(str(earlier)) as container:
                self._take_over(container, copy)
        except (av.FFmpegError, IndexError, ValueError) as error:
            raise ImageError(
                earlier,
                expected=f"the {self._images} images before the run was stopped",
                found=str(error),
                advice="start again with --overwrite",
            ) from error
        with writing(self.path):
            copy.replace(self.partial_path)

    def _take_over(self, earlier: InputContainer, copy: Path) -> None:
        """Copy the images of a file into a new one, as they are, and those that it does not hold yet."""
        (source,) = earlier.streams.video
        packets = (packet for packet in earlier.demux(source) if packet.size)
        found = ((_with_start_codes(bytes(one)), one.is_keyframe) for one in packets)
        images = list(self._newest)
        self._open((source.height, source.width), copy)
        for number in range(self._images):
            data, is_keyframe = next(found, None) or images[number - self._images]
            self._mux(number, data, is_keyframe=is_keyframe)

    def _mux(self, number: int, data: bytes, *, is_keyframe: bool) -> None:
        packet = av.Packet(data)
        packet.stream, packet.time_base = self._stream, 1 / self._rate_hz
        packet.pts = packet.dts = number
        packet.duration, packet.is_keyframe = 1, is_keyframe
        assert self._container is not None
        with writing(self.path):
            self._container.mux(packet)

    def _open(self, size_px: tuple[int, ...], path: Path) -> OutputContainer:
        """Open a file for images of (height, width)."""
        height, width = size_px
        if height % 2 or width % 2:
            raise ImageError(
                self.path,
                expected="images of even width and height",
                found=f"{width}x{height} pixels",
            )
        encoder = _best_encoder()
        flags = "faststart"
        if av.library_versions["libavformat"][:2] >= _HYBRID_SINCE:
            flags = "hybrid_fragmented+frag_every_frame"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        options = {"movflags": flags, "flush_packets": "1"}
        container = av.open(str(path), "w", format="mp4", options=options)
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


def _with_start_codes(data: bytes) -> bytes:
    """Return an image of an MP4 file as the encoder gave it: units of H.264 behind start codes, not behind lengths."""
    units, first = [], 0
    while first < len(data):
        length = int.from_bytes(data[first : first + 4], "big")
        units.append(data[first + 4 : first + 4 + length])
        first += 4 + length
    return b"".join(b"\0\0\0\1" + unit for unit in units)


def open_video(path: Path | None, rate_hz: float = 10.0) -> ImageSink:
    """Return the writer of a file, or one that drops all images where there is no path."""
    return NullVideoWriter() if path is None else VideoWriter(path, rate_hz)


def _best_encoder() -> str:
    encoder = next(name for name in _ENCODERS if name in av.codecs_available)
    if encoder == "mpeg4":
        _LOG.warning("This build of PyAV has no H.264 encoder: the video is MPEG-4 Part 2.")
    return encoder
