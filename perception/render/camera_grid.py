"""Where the images of one or several cameras are drawn: cells of equal size, side by side and below each other."""

from dataclasses import dataclass

import numpy as np

from perception.render.panels import PanelArea, left_column_px
from perception.types import Result, UInt8

_GAP_PX = 2


@dataclass(frozen=True)
class CameraGrid:
    """Cells for the images of a frame's cameras, row by row.

    Attributes:
        cameras: Number of cameras.
        columns: Number of cells side by side.
        aspect: Width of an image over its height.
    """

    cameras: int
    columns: int
    aspect: float

    @property
    def rows(self) -> int:
        """Number of cells below each other."""
        return -(-self.cameras // self.columns)

    @property
    def total_aspect(self) -> float:
        """Width of all cells over their height."""
        return self.aspect * self.columns / self.rows

    def cells(self, size_px: tuple[int, int]) -> list[PanelArea]:
        """Return the cell of each camera in a panel of (width, height)."""
        lefts, tops = (
            np.rint(np.linspace(0, size + _GAP_PX, count + 1)).astype(int).tolist()
            for size, count in zip(size_px, (self.columns, self.rows), strict=True)
        )
        places = [divmod(number, self.columns) for number in range(self.cameras)]
        return [
            PanelArea(
                lefts[column], tops[row], lefts[column + 1] - _GAP_PX, tops[row + 1] - _GAP_PX
            )
            for row, column in places
        ]


def camera_grid(
    result: Result, body_px: tuple[int, int], max_image_share: float
) -> CameraGrid | None:
    """Return the cells with the largest images; None without a calibrated camera that has an image.

    One of several cameras that has no image in this frame keeps its cell, so that no image changes its place.

    Args:
        result: Result of the frame.
        body_px: (width, height) of the column of cameras and of that beside it.
        max_image_share: Share of the height that all images take at most.
    """
    views = result.frame.views
    aspects = [
        aspect_of(view.image)
        for view in views
        if view.image is not None and view.calibration is not None
    ]
    if not aspects:
        return None
    grids = [
        CameraGrid(len(views), columns, float(np.median(aspects)))
        for columns in range(1, len(views) + 1)
    ]
    return max(grids, key=lambda grid: _image_px(grid, body_px, max_image_share))


def aspect_of(image: UInt8) -> float:
    """Return width over height of an (H, W, 3) image."""
    return float(image.shape[1] / image.shape[0])


def _image_px(grid: CameraGrid, body_px: tuple[int, int], max_image_share: float) -> float:
    """Return the width of each image in a grid."""
    width, height = left_column_px(body_px, grid.total_aspect, max_image_share)
    return min(width / grid.columns, height / grid.rows * grid.aspect)
