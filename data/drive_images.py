"""Images of a drive's camera, one of each frame, wherever they lie."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from data.kitti.sensor_files import ImageSize, read_image
from data.per_frame import PerFrame
from perception.geometry.undistortion import Lens
from perception.types import UInt8


class DriveImages(PerFrame):
    """Images of one camera."""

    @abstractmethod
    def read(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of a frame, or None where the frame has none.

        Raises:
            ImageError: The image is missing, damaged or of another size.
        """

    def file(self, index: int) -> Path | None:
        """Return the file of one image; None where the frame has none, or many lie in one file."""
        return None

    def is_missing(self, index: int) -> bool:
        """Return whether the image of a frame is a file that is not there."""
        file = self.file(index)
        return file is not None and not file.exists()


@dataclass(frozen=True)
class ImageFiles(DriveImages):
    """Images in files of their own.

    Attributes:
        paths: (F) image of each frame, None where none belongs to it.
        size: Size that every image must have, or None.
        lens: Lens whose distortion is taken out, or None.
    """

    paths: tuple[Path | None, ...]
    size: ImageSize | None = None
    lens: Lens | None = None

    def select(self, indices: Sequence[int]) -> Self:
        """Return the images of some frames."""
        return replace(self, paths=tuple(self.paths[index] for index in indices))

    def read(self, index: int) -> UInt8 | None:
        """Read the (H, W, 3) image of a frame."""
        path = self.paths[index]
        if path is None:
            return None
        image = read_image(path, self.size)
        return image if self.lens is None else self.lens.undistort(image)

    def file(self, index: int) -> Path | None:
        """Return the file of one image."""
        return self.paths[index]
