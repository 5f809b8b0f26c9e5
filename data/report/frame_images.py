"""Images of the player: panels of the video as JPEGs, of so many frames that a page stays below 30 MB."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from data.image_decoder import decode_image
from perception.errors import ImageError
from perception.render.panels import PanelArea
from perception.types import Progress, UInt8

# Of all frames together, before base64 makes a third more of them: with Plotly's 5 MB a page stays below 30 MB.
MAX_IMAGE_BYTES = 16_500_000
MAX_FRAMES = 200
# Best first; both panels of a frame of 1,600 x 780 pixels take about 165, 120, 105 and 100 kB.
_QUALITIES = (75, 65, 55, 45)
_MAX_FRAME_BYTES = 150_000
_FALLS_SHORT = 0.7  # of what is allowed: the next frame is encoded better
_VIDEOS = ("video.mp4", "video.partial.mp4")
_PANELS = "panels"
_WHOLE = "Video"


@dataclass(frozen=True)
class FrameImages:
    """JPEGs of the views of some frames.

    Attributes:
        views: Names of the views.
        sizes_px: (width, height) of each view.
        images: JPEGs of each view by the row of the frame in `frames.jsonl`.
    """

    views: Sequence[str] = ()
    sizes_px: Sequence[tuple[int, int]] = ()
    images: Mapping[int, Sequence[bytes]] = field(default_factory=dict)


class ImageCollection:
    """Keeps the images of as many frames as fit: where they are too large, every second frame is dropped."""

    def __init__(self, frames: int, max_bytes: int = MAX_IMAGE_BYTES) -> None:
        """Start without images.

        Args:
            frames: Number of frames of the drive.
            max_bytes: Number of bytes of all images that are kept.
        """
        self.step = max(-(-frames // MAX_FRAMES), 1)
        self.images: dict[int, Sequence[bytes]] = {}
        self._max_bytes = max_bytes
        self._frames, self._quality = frames, 0

    def takes(self, row: int) -> bool:
        """Return whether the images of a frame are kept, by its row."""
        return row % self.step == 0

    def add(self, row: int, panels: Sequence[UInt8]) -> None:
        """Encode and keep the (H, W, 3) RGB panels of a frame that is taken."""
        allowed = self._allowed_bytes(row)
        images = _encoded(panels, _QUALITIES[self._quality])
        while _size(images) > allowed and self._quality < len(_QUALITIES) - 1:
            self._quality += 1
            images = _encoded(panels, _QUALITIES[self._quality])
        if _size(images) < _FALLS_SHORT * allowed:
            self._quality = max(self._quality - 1, 0)
        self.add_encoded(row, images)

    def _allowed_bytes(self, row: int) -> float:
        """Return the bytes for a frame, so that all later ones have as many."""
        free = self._max_bytes - sum(map(_size, self.images.values()))
        return min(free / max(-(-(self._frames - row) // self.step), 1), _MAX_FRAME_BYTES)

    def add_encoded(self, row: int, images: Sequence[bytes]) -> None:
        """Keep the JPEGs of a frame that is taken."""
        self.images[row] = images
        while sum(map(_size, self.images.values())) > self._max_bytes and len(self.images) > 1:
            self.step *= 2
            self.images = {row: one for row, one in self.images.items() if self.takes(row)}


def read_frame_images(
    folder: Path,
    areas: Mapping[str, PanelArea],
    frames: int,
    max_bytes: int = MAX_IMAGE_BYTES,
    progress: Progress = iter,
) -> FrameImages:
    """Return the images of a run: of its video, else of the panels that it left; none where there are neither.

    Args:
        folder: Folder of the run.
        areas: Panels of an image of the video by name; the whole image where none is known.
        frames: Number of frames of the run.
        max_bytes: Number of bytes of all images.
        progress: Progress bar around the rows of the video.

    Raises:
        ImageError: The video is damaged.
    """
    collection = ImageCollection(frames, max_bytes)
    video = next((folder / name for name in _VIDEOS if (folder / name).is_file()), None)
    if video is None:
        return _read_panels(folder / _PANELS, collection)
    names, sizes = tuple(areas), [area.size_px for area in areas.values()]
    for row, image in _video_images(video, collection, progress(range(frames))):
        if not names:
            names, sizes = (_WHOLE,), [(image.shape[1], image.shape[0])]
        panels = [area.of(image) for area in areas.values()] or [image]
        collection.add(row, panels)
    return FrameImages(names, sizes, collection.images)


def write_panels(folder: Path, row: int, panels: Mapping[str, UInt8]) -> None:
    """Write the panels of a frame of a run without a video.

    Args:
        folder: Folder of the run.
        row: Row of the frame in `frames.jsonl`.
        panels: (H, W, 3) RGB panels by name, at most ten.
    """
    from perception.atomic_file import write_jpeg

    for number, (name, panel) in enumerate(panels.items()):
        write_jpeg(folder / _PANELS / f"{row:06d}-{number}-{_file_word(name)}.jpg", panel, 80)


def _read_panels(folder: Path, collection: ImageCollection) -> FrameImages:
    files: dict[int, list[Path]] = {}
    for path in sorted(folder.glob("*-?-*.jpg")):
        files.setdefault(int(path.name.partition("-")[0]), []).append(path)
    for row, paths in files.items():
        collection.add_encoded(row, [path.read_bytes() for path in paths])
    first = next(iter(files.values()), [])
    names = [path.stem.split("-", 2)[2].replace("_", " ").capitalize() for path in first]
    return FrameImages(names, [_size_px(path) for path in first], collection.images)


def _size_px(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file.

    Raises:
        ImageError: It is damaged.
    """
    image = decode_image(path.read_bytes(), path, advice="run the drive again with --overwrite")
    return image.shape[1], image.shape[0]


def _video_images(
    video: Path, collection: ImageCollection, rows: Iterable[int]
) -> Iterator[tuple[int, UInt8]]:
    """Yield row and image of each frame of a video that is taken."""
    import av

    try:
        with av.open(str(video)) as container:
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            for row, frame in zip(rows, container.decode(stream), strict=False):
                if collection.takes(row):
                    yield row, np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
    except (av.FFmpegError, IndexError) as error:
        raise ImageError(
            video,
            expected="a video that `trifuse run` wrote",
            found=str(error),
            advice="remove it; the report is written without images then",
        ) from error


def _encoded(panels: Sequence[UInt8], quality: int) -> list[bytes]:
    settings = (cv2.IMWRITE_JPEG_QUALITY, quality)
    return [
        bytes(cv2.imencode(".jpg", cv2.cvtColor(panel, cv2.COLOR_RGB2BGR), settings)[1])
        for panel in panels
    ]


def _size(images: Sequence[bytes]) -> int:
    return sum(map(len, images))


def _file_word(name: str) -> str:
    return "_".join(name.partition(",")[0].lower().split())
