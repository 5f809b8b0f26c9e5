"""The occupancy grid, as the costmaps of Nav2 take it."""

from typing import Any

from data.messages.definitions import message
from data.messages.geometry import WORLD, header, time, upright_pose
from perception.types import OccupancyGrid


def occupancy(stamp_s: float, grid: OccupancyGrid) -> Any:  # noqa: ANN401 - a message
    """Return a grid in the world; its cells are -1 unknown, 0 free, 100 occupied."""
    height, width = grid.states.shape
    metadata = message(
        "nav_msgs/MapMetaData",
        map_load_time=time(stamp_s),
        resolution=grid.cell_m,
        width=width,
        height=height,
        origin=upright_pose(grid.origin_m),
    )
    return message(
        "nav_msgs/OccupancyGrid",
        header=header(stamp_s, WORLD),
        info=metadata,
        data=grid.states.ravel(),
    )
