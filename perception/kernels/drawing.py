"""Points and cubes drawn into images, pixel by pixel."""

import math

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, ArrayType, array_of, compiled, written
from perception.types import Float, Float64, Int, UInt8

# Number of a point that is not drawn.
HIDDEN = 255
_NEAREST_M = 0.6
# A cube at an angle is broader than its edge; a full diagonal would hide the cubes behind it.
_SPREAD = 1.2
_PROJECTION = array_of(np.float64, 2)
_POINTS = array_of(np.float32, 2)
_CANVAS = ArrayType(np.uint8, 3, is_written=True, is_contiguous=False)


@compiled((_CANVAS, _PROJECTION, _POINTS, array_of(np.uint8), array_of(np.uint8, 2), WHOLE))
def paint_points(
    canvas: UInt8, image_P_velo: Float64, points: Float, numbers: UInt8, colors: UInt8, edge_px: int
) -> None:
    """Draw each point as a square, the last on top; those behind the camera are left out.

    Args:
        canvas: (H, W, 3) canvas.
        image_P_velo: (3, 4) projection to the canvas.
        points: (N, 3+) points.
        numbers: (N,) number of the colour of each point, or `HIDDEN`.
        colors: (C, 3) colours.
        edge_px: Edge of the squares in pixels.
    """
    height, width = canvas.shape[:2]
    p = image_P_velo
    half = (edge_px - 1) / 2
    for i in range(len(points)):
        if numbers[i] == HIDDEN:
            continue
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth_m = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z + p[2, 3]
        if not depth_m > 1e-6:
            continue
        u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / depth_m - half
        v = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / depth_m - half
        if not (-edge_px < u < width and -edge_px < v < height):
            continue
        left, top = int(np.rint(u)), int(np.rint(v))
        for row in range(max(top, 0), min(top + edge_px, height)):
            for column in range(max(left, 0), min(left + edge_px, width)):
                for channel in range(3):
                    canvas[row, column, channel] = colors[numbers[i], channel]


@compiled((written(np.int32, 2), _PROJECTION, _POINTS, NUMBER))
def splat_cubes(nearest: Int, image_P_velo: Float64, centers_m: Float, size_m: float) -> None:
    """Write the number of the nearest cube of each pixel, each cube a square as large as it appears.

    Args:
        nearest: (H, W) numbers of the cubes; other pixels stay as they are.
        image_P_velo: (3, 4) projection.
        centers_m: (V, 3) centres of the cubes.
        size_m: Edge of the cubes in metres.
    """
    height, width = nearest.shape
    p = image_P_velo
    across = np.array([
        p[0, 1] * p[2, 2] - p[0, 2] * p[2, 1],
        p[0, 2] * p[2, 0] - p[0, 0] * p[2, 2],
        p[0, 0] * p[2, 1] - p[0, 1] * p[2, 0],
    ])  # fmt: skip
    scale_px = _SPREAD * size_m * math.sqrt((across**2).sum() / (p[2, :3] ** 2).sum())
    depths_m = np.full((height, width), np.inf, np.float32)
    for i in range(len(centers_m)):
        x, y, z = centers_m[i, 0], centers_m[i, 1], centers_m[i, 2]
        depth_m = p[2, 0] * x + p[2, 1] * y + p[2, 2] * z + p[2, 3]
        if not depth_m > _NEAREST_M:
            continue
        edge_px = max(int(np.rint(scale_px / depth_m)), 1)
        half = (edge_px - 1) / 2
        u = (p[0, 0] * x + p[0, 1] * y + p[0, 2] * z + p[0, 3]) / depth_m - half
        v = (p[1, 0] * x + p[1, 1] * y + p[1, 2] * z + p[1, 3]) / depth_m - half
        if not (-edge_px < u < width and -edge_px < v < height):
            continue
        left, top, depth = int(np.rint(u)), int(np.rint(v)), np.float32(depth_m)
        for row in range(max(top, 0), min(top + edge_px, height)):
            for column in range(max(left, 0), min(left + edge_px, width)):
                if depth <= depths_m[row, column]:
                    depths_m[row, column] = depth
                    nearest[row, column] = i


@compiled((written(np.uint8, 2), array_of(np.int32, 2), _PROJECTION, _POINTS, NUMBER))
def faces_of_cubes(
    faces: UInt8, nearest: Int, image_P_velo: Float64, centers_m: Float, size_m: float
) -> None:
    """Write the face through which the ray of each pixel enters its cube: 0 across x, 1 across y, 2 across z.

    A ray enters a slab half an edge before its middle, and the cube with its last slab.

    Args:
        faces: (H, W) faces; pixels without a cube stay as they are.
        nearest: (H, W) number of the cube of each pixel, -1 without one.
        image_P_velo: (3, 4) projection.
        centers_m: (V, 3) centres of the cubes.
        size_m: Edge of the cubes in metres.
    """
    height, width = nearest.shape
    turn = np.linalg.inv(image_P_velo[:, :3].copy())
    camera_m = -(turn @ image_P_velo[:, 3].copy())
    half_m = size_m / 2
    for row in range(height):
        for column in range(width):
            cube = nearest[row, column]
            if cube < 0:
                continue
            # Of two fractions with positive denominators, the larger one is told without a division.
            face, latest_m, latest_speed = 0, 0.0, 0.0
            for axis in range(3):
                ray = turn[axis, 0] * column + turn[axis, 1] * row + turn[axis, 2]
                middle_m = centers_m[cube, axis] - camera_m[axis]
                speed = max(abs(ray), 1e-9)
                enters_m = (-middle_m if ray < -1e-9 else middle_m) - half_m
                if axis == 0 or enters_m * latest_speed > latest_m * speed:
                    face, latest_m, latest_speed = axis, enters_m, speed
            faces[row, column] = face


@compiled(
    (
        _CANVAS,
        (array_of(np.int32, 2), array_of(np.uint8, 2)),
        (array_of(np.uint8, 2),) * 3,
        (array_of(np.uint8, 3), _PROJECTION),
        (NUMBER,) * 3,
    )
)
def blend_overlay(
    canvas: UInt8,
    cubes: tuple[Int, UInt8],
    ground: tuple[UInt8, UInt8, UInt8],
    colors: tuple[UInt8, Float64],
    opacities: tuple[float, float, float],
) -> None:
    """Blend cubes, and the ground beside them, into a canvas.

    Args:
        canvas: (H, W, 3) canvas.
        cubes: (H, W) number of the cube of each pixel, -1 without one; (H, W) visible face of that cube.
        ground: (H, W) 255 on the ground, else 0; (H, W) share of each pixel that a line on it covers, 0 to 255;
            (H, W) 1 where both are hidden, as behind every cube, else 0.
        colors: (V, 3, 3) colour of each face of each cube; (2, 3) colours of the ground and of its lines.
        opacities: Opacity of the cubes, that of the ground, and what a line adds to it, 0 to 1.
    """
    (nearest, faces), (fill, mesh, hidden), (cube_colors, ground_colors) = cubes, ground, colors
    height, width = nearest.shape
    cube_share, ground_share = round(256 * opacities[0]), round(256 * opacities[1])
    # Most pixels of the ground are bare, whose blending has one factor and one summand for each channel.
    bare = np.rint(ground_share * ground_colors[0] + 128).astype(np.int64)
    for row in range(height):
        for column in range(width):
            cube = nearest[row, column]
            if cube >= 0:
                face = faces[row, column]
                for channel in range(3):
                    color = np.int64(cube_colors[cube, face, channel])
                    below = np.int64(canvas[row, column, channel])
                    mixed = cube_share * color + (256 - cube_share) * below + 128
                    canvas[row, column, channel] = mixed >> 8
            elif hidden[row, column]:
                continue
            elif mesh[row, column]:
                on_line = mesh[row, column] / 255
                opacity = opacities[1] * fill[row, column] / 255 + opacities[2] * on_line
                for channel in range(3):
                    change = ground_colors[1, channel] - ground_colors[0, channel]
                    color_on_line = ground_colors[0, channel] + on_line * change
                    under = canvas[row, column, channel]
                    canvas[row, column, channel] = int(
                        under + opacity * (color_on_line - under) + 0.5
                    )
            elif fill[row, column]:
                for channel in range(3):
                    below = np.int64(canvas[row, column, channel])
                    mixed = bare[channel] + (256 - ground_share) * below
                    canvas[row, column, channel] = mixed >> 8


@compiled((array_of(np.int64, 2), *(array_of(np.float64, 2),) * 2))
def best_place(places_px: Int, taken_px: Float64, avoided_px: Float64) -> int:
    """Return the number of the rectangle that covers the smallest area of others, -1 where none is free.

    Args:
        places_px: (P, 4) left, top, right and bottom of rectangles, the best first.
        taken_px: (T, 4) rectangles that it must not touch.
        avoided_px: (A, 4) rectangles of which it should cover little.
    """
    best, smallest = -1, np.inf
    for place in range(len(places_px)):
        left, top, right, bottom = places_px[place]
        is_free = True
        for other in range(len(taken_px)):
            across = min(right, taken_px[other, 2]) - max(left, taken_px[other, 0])
            along = min(bottom, taken_px[other, 3]) - max(top, taken_px[other, 1])
            if across > 0 and along > 0:
                is_free = False
                break
        if not is_free:
            continue
        covered = 0.0
        for other in range(len(avoided_px)):
            across = min(right, avoided_px[other, 2]) - max(left, avoided_px[other, 0])
            along = min(bottom, avoided_px[other, 3]) - max(top, avoided_px[other, 1])
            covered += max(across, 0.0) * max(along, 0.0)
        if covered < smallest:
            best, smallest = place, covered
    return best
