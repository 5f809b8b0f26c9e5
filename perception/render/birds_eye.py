"""The local area from above: each `draw_*` paints one layer onto a canvas.

      ^ x ahead          A `BirdsEyeView` maps metres of the LiDAR frame to pixels,
      |                  the vehicle's heading up.
y <---o
"""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.geometry.grids import LocalArea
from perception.kernels.drawing import paint_points
from perception.render import palette
from perception.render.canvas import (
    FIXED_POINT_BITS,
    Align,
    draw_text,
    fill_canvas,
    fixed_point,
    text_width_px,
)
from perception.render.ego_vehicle import vehicle_outline_m
from perception.render.overlay import GroundMesh
from perception.render.palette import Color
from perception.types import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Float,
    Float64,
    Int,
    OccupancyGrid,
    PointState,
    Result,
    UInt8,
    Voxels,
)

_RING_STEP_M = 10.0
_SCALE_M = 5.0
# Height above the ground from which static voxels have their full colour; they are dark at the ground.
_FULL_HEIGHT_M = 1.8
# Colours of static voxels by brightness, 0 to 255, and of moving ones.
_STATIC = (np.arange(256)[:, None] / 255 * palette.STATIC).astype(np.uint8)
_MOVING = np.array([palette.MOVING], np.uint8)
# Colours of the states of cells; unknown ones have none.
_STATES = np.array([UNKNOWN, FREE, OCCUPIED])
_OCCUPANCY = np.array([(0, 0, 0), palette.FREE, palette.OCCUPIED], np.uint8)
_TINT = 0.45
# Direction to the light, from the front left; slopes are drawn steeper than they are.
_TO_LIGHT = np.array([0.5, 0.5, 0.7])
_SLOPE_EXAGGERATION = 4.0


@dataclass(frozen=True)
class BirdsEyeView:
    """Projection of the LiDAR frame onto a canvas from above.

    Attributes:
        size_px: (width, height) of the canvas.
        pixels_per_m: Scale in pixels per metre.
        vehicle_px: (column, row) of the LiDAR.
    """

    size_px: tuple[int, int]
    pixels_per_m: float
    vehicle_px: tuple[float, float]

    def to_pixels(self, points_m: Float) -> Float64:
        """Return (N, 2) columns and rows of (N, 2+) points."""
        column = self.vehicle_px[0] - points_m[:, 1] * self.pixels_per_m
        row = self.vehicle_px[1] - points_m[:, 0] * self.pixels_per_m
        return np.stack([column, row]).astype(np.float64).T

    @property
    def image_P_velo(self) -> Float64:
        """(3, 4) projection from the LiDAR frame, from infinite height: every depth is 1."""
        column, row = self.vehicle_px
        scale = self.pixels_per_m
        return np.array([[0, -scale, 0, column], [-scale, 0, 0, row], [0, 0, 0, 1.0]])

    @property
    def reach_m(self) -> float:
        """Distance from the LiDAR to the farthest corner of the canvas in metres."""
        column, row = self.vehicle_px
        width, height = self.size_px
        return float(np.hypot(max(column, width - column), max(row, height - row))) / (
            self.pixels_per_m
        )


def view_of_area(area: LocalArea, size_px: tuple[int, int]) -> BirdsEyeView:
    """Return the view that shows the local area centred, at the largest scale."""
    width, height = size_px
    length_m, breadth_m = area.ahead_m + area.behind_m, 2 * area.side_m
    scale = min(width / breadth_m, height / length_m)
    top_px = (height - length_m * scale) / 2
    return BirdsEyeView(size_px, scale, (width / 2, top_px + area.ahead_m * scale))


def draw_birds_eye(canvas: UInt8, view: BirdsEyeView, result: Result, surface: GroundMesh) -> None:
    """Fill a canvas with ground, occupancy, points, obstacles, range rings and the vehicle.

    Args:
        canvas: (H, W, 3) canvas.
        view: View from above.
        result: Output of the pipeline.
        surface: Ground.
    """
    fill_canvas(canvas, palette.PANEL)
    draw_ground(canvas, view, surface)
    if result.occupancy is not None:
        draw_occupancy(canvas, view, result.occupancy, result.world_SE3_velo)
    draw_points(canvas, view, result)
    draw_rings(canvas, view)
    draw_static(canvas, view, result.obstacles.static, surface)
    draw_squares(canvas, view, result.obstacles.moving, _MOVING)
    draw_vehicle(canvas, view)


def draw_ground(canvas: UInt8, view: BirdsEyeView, surface: GroundMesh) -> None:
    """Shade the ground as a relief; flat ground is evenly blue."""
    along_x, along_y = surface.slope()
    normal = np.stack(
        [-_SLOPE_EXAGGERATION * along_x, -_SLOPE_EXAGGERATION * along_y, np.ones_like(along_x)]
    )
    light = np.tensordot(_TO_LIGHT, normal / np.linalg.norm(normal, axis=0), axes=1)
    brightness = np.clip(0.42 * light / _TO_LIGHT[2], 0.15, 0.9)[..., None]
    relief = (brightness * palette.GROUND).astype(np.uint8)
    # The relief's axes run ahead and to the left, those of the canvas back and to the right.
    corners = view.to_pixels(
        np.array([(surface.x_m[-1], surface.y_m[-1]), (surface.x_m[0], surface.y_m[0])])
    )
    (left, top), (right, bottom) = np.rint(corners).astype(int)
    turned = np.ascontiguousarray(relief[::-1, ::-1])
    resized = cv2.resize(turned, (right - left, bottom - top))
    height, width = canvas.shape[:2]
    rows = slice(max(top, 0), min(bottom, height))
    columns = slice(max(left, 0), min(right, width))
    canvas[rows, columns] = resized[
        rows.start - top : rows.stop - top, columns.start - left : columns.stop - left
    ]


def draw_occupancy(
    canvas: UInt8, view: BirdsEyeView, grid: OccupancyGrid, world_SE3_velo: Float64
) -> None:
    """Tint free and occupied cells; what is unknown stays as it is.

    Args:
        canvas: (H, W, 3) canvas.
        view: View from above.
        grid: Grid in the world.
        world_SE3_velo: (4, 4) pose of the LiDAR in the world.
    """
    # Centres of three cells, on the ground, and where they are drawn.
    cells = np.array([[0, 0], [grid.states.shape[1] - 1, 0], [0, grid.states.shape[0] - 1]])
    centers_m = np.column_stack([(cells + 0.5) * grid.cell_m, np.zeros(3)]) + grid.origin_m
    centers_velo = (centers_m - world_SE3_velo[:3, 3]) @ world_SE3_velo[:3, :3]
    places_px = view.to_pixels(centers_velo)
    canvas_A_grid = cv2.getAffineTransform(cells.astype(np.float32), places_px.astype(np.float32))
    tint = cv2.warpAffine(
        _OCCUPANCY[np.searchsorted(_STATES, grid.states)],
        canvas_A_grid,
        view.size_px,
        flags=cv2.INTER_NEAREST,
    )
    is_known = tint.any(axis=2)
    mixed = cv2.addWeighted(canvas, 1 - _TINT, tint, _TINT, 0)
    canvas[is_known] = mixed[is_known]


def draw_points(canvas: UInt8, view: BirdsEyeView, result: Result) -> None:
    """Draw every point of the scan: pale on the ground, grey outside the local area."""
    tints = np.array([palette.POINTS] * len(PointState), np.uint8)
    tints[PointState.GROUND] = palette.GROUND_POINTS
    points, states = result.frame.points_velo, result.obstacles.point_states
    paint_points(canvas, view.image_P_velo, points, states, tints, 1)


def draw_static(canvas: UInt8, view: BirdsEyeView, voxels: Voxels, surface: GroundMesh) -> None:
    """Draw static voxels as squares, brighter with height, the highest on top."""
    above_m = voxels.centers_m[:, 2] - float(np.median(surface.height_m))
    lowest_first = np.argsort(above_m, kind="stable")
    brightness = np.clip(0.5 + 0.5 * above_m / _FULL_HEIGHT_M, 0.4, 1.0)[lowest_first]
    levels = np.rint(255 * brightness).astype(np.uint8)
    ordered = Voxels(voxels.centers_m[lowest_first], voxels.counts[lowest_first], voxels.size_m)
    draw_squares(canvas, view, ordered, _STATIC, levels)


def draw_squares(
    canvas: UInt8, view: BirdsEyeView, voxels: Voxels, colors: UInt8, numbers: UInt8 | None = None
) -> None:
    """Fill the footprint of each voxel, the last on top.

    Args:
        canvas: (H, W, 3) canvas.
        view: View from above.
        voxels: (V) voxels in the LiDAR frame.
        colors: (C, 3) colours.
        numbers: (V,) number of the colour of each voxel; else all have the first.
    """
    edge_px = max(int(np.ceil(voxels.size_m * view.pixels_per_m)), 1)
    points = np.ascontiguousarray(voxels.centers_m, np.float32)
    numbers = np.zeros(len(points), np.uint8) if numbers is None else numbers
    paint_points(canvas, view.image_P_velo, points, numbers, colors, edge_px)


def draw_rings(canvas: UInt8, view: BirdsEyeView) -> None:
    """Draw range rings every ten metres around the vehicle."""
    center = tuple(round(value * 2**FIXED_POINT_BITS) for value in view.vehicle_px)
    for radius_m in np.arange(_RING_STEP_M, view.reach_m, _RING_STEP_M):
        radius = round(radius_m * view.pixels_per_m * 2**FIXED_POINT_BITS)
        cv2.circle(canvas, center, radius, palette.GRID, 1, cv2.LINE_AA, FIXED_POINT_BITS)


def draw_scale(canvas: UInt8, view: BirdsEyeView, text_px: int) -> list[Int]:
    """Draw the radii of the rings ahead and behind, and a scale bar in the lower left corner.

    Returns:
        (4,) left, top, right and bottom of the areas of the text.
    """
    height, (column, row) = view.size_px[1], view.vehicle_px
    gap_px, areas = 0.6 * text_px, []
    for x_m in np.arange(-_RING_STEP_M * 20, _RING_STEP_M * 20, _RING_STEP_M):
        at = (column, row - x_m * view.pixels_per_m)
        if x_m and 3 * text_px < at[1] < height - 3 * text_px:
            areas.append(_write_on_tag(canvas, f"{abs(x_m):.0f} m", at, text_px))
    bar_px, bottom = round(_SCALE_M * view.pixels_per_m), height - 2 * text_px
    ends = [(2 * text_px, bottom), (2 * text_px + bar_px, bottom)]
    for color, thick_px in ((palette.BACKGROUND, 6), (palette.TEXT, 2)):
        cv2.line(canvas, ends[0], ends[1], color, thick_px)
    at = (2 * text_px + bar_px / 2, bottom - text_px - gap_px)
    area = _write_on_tag(canvas, f"{_SCALE_M:.0f} m", at, text_px)
    return [*areas, np.array([0, area[1], 3 * text_px + bar_px, height])]


def _write_on_tag(canvas: UInt8, text: str, center_px: tuple[float, float], text_px: int) -> Int:
    """Write text on a darkened part of the canvas; return (4,) left, top, right and bottom of it."""
    half_px = np.array([text_width_px(text, text_px) / 2 + 0.4 * text_px, 0.9 * text_px])
    low, high = np.rint(center_px - half_px).astype(int), np.rint(center_px + half_px).astype(int)
    tag = canvas[max(low[1], 0) : high[1], max(low[0], 0) : high[0]]
    tag[:] = tag // 3
    baseline = (center_px[0], center_px[1] + 0.5 * text_px)
    draw_text(canvas, text, baseline, height_px=text_px, align=Align.CENTER)
    return np.array([*low, *high])


def draw_vehicle(canvas: UInt8, view: BirdsEyeView) -> None:
    """Draw the vehicle's outline with an arrow along its heading."""
    draw_polygon(canvas, view, vehicle_outline_m(), palette.VEHICLE)
    draw_polygon(canvas, view, np.array([(2.3, 0.0), (1.2, 0.55), (1.2, -0.55)]), palette.GLASS)


def draw_polygon(canvas: UInt8, view: BirdsEyeView, corners_m: Float, color: Color) -> None:
    """Fill the polygon of (C, 2+) corners."""
    corners = fixed_point(view.to_pixels(corners_m))
    cv2.fillPoly(canvas, [corners], color, cv2.LINE_AA, FIXED_POINT_BITS)
