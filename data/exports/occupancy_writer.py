"""Occupancy grids of a run: an image and YAML as the map server of Nav2 reads them, and the arrays."""

from pathlib import Path

import cv2
import numpy as np

from data.results.result_writer import ResultWriter
from perception.atomic_file import atomic_file, write_atomically
from perception.render.scene import SelectedObject
from perception.types import FREE, OCCUPIED, OccupancyGrid, Result, UInt8

# Grey levels of map_server: of 205, the share of black is just above the threshold of what is free.
_GREY = {FREE: 254, OCCUPIED: 0}
_UNKNOWN_GREY = 205
_YAML = """image: {image}
mode: trinary
resolution: {cell_m:g}
origin: [{x:.6f}, {y:.6f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


class OccupancyWriter(ResultWriter):
    """Writes three files a frame into `occupancy/`."""

    def __init__(self, out: Path) -> None:
        """Write nothing yet.

        Args:
            out: Folder of the results.
        """
        self._folder = out / "occupancy"

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Write the grid of a frame.

        Raises:
            WriteError: The disk is full.
        """
        del selected
        grid, path = result.occupancy, self._folder / result.frame.name
        if grid is None:
            return
        x, y, _ = grid.origin_m
        text = _YAML.format(image=f"{path.name}.png", cell_m=grid.cell_m, x=x, y=y)
        _, encoded = cv2.imencode(".png", map_image(grid))
        write_atomically(path.with_suffix(".png"), encoded.tobytes())
        with atomic_file(path.with_suffix(".npz")) as part:
            np.savez_compressed(
                part, states=grid.states, origin_m=grid.origin_m, cell_m=grid.cell_m
            )
        write_atomically(path.with_suffix(".yaml"), text.encode())

    def snapshot(self) -> bytes:
        """Return nothing: each frame has files of its own."""
        return b""

    def restore(self, snapshot: bytes) -> None:
        """Go on with the next frame."""

    def close(self, *, is_complete: bool) -> None:
        """Leave the files of the frames that are done."""


def map_image(grid: OccupancyGrid) -> UInt8:
    """Return the (H, W) grey image of a map: y up, free white, occupied black."""
    image = np.full(grid.states.shape, _UNKNOWN_GREY, np.uint8)
    for state, grey in _GREY.items():
        image[grid.states == state] = grey
    return image[::-1]
