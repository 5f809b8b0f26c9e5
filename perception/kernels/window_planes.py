"""Planes through the returns around pixels: where they lie flat, so does what the image shows there."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled
from perception.kernels.moments import add_point, flattest_direction, write_covariance
from perception.types import Float32, Float64, Int

_ROWS = array_of(np.float64, 2)
# A surface seen at a slope is long and narrow in a window, but wider than the noise of its returns.
_MIN_BREADTH, _MAX_THICKNESS = 1e-4, 0.2
# Standard deviation through a surface, and more by its distance.
_MAX_FLATNESS_M, _MAX_FLATNESS_SHARE = 0.03, 0.001
_MIN_GRAZING = 0.02  # sine of the least angle between a beam and the surface


@compiled((array_of(np.float32, 2), _ROWS, NUMBER, WHOLE, WHOLE, NUMBER, NUMBER))
def moments_of_view(
    points: Float32,
    image_P_velo: Float64,
    cell_px: float,
    columns: int,
    rows: int,
    nearest_m: float,
    farthest_m: float,
) -> Float64:
    """Return the (rows, columns, 10) moments of the returns in each cell of an image.

    Args:
        points: (N, 4) points.
        image_P_velo: (3, 4) projection to pixels.
        cell_px: Edge of a cell in pixels.
        columns: Number of cells across.
        rows: Number of cells down.
        nearest_m: Depth in metres from which on returns count.
        farthest_m: Depth in metres up to which they do.
    """
    moments = np.zeros((rows, columns, 10))
    P = image_P_velo
    for k in range(len(points)):
        x, y, z = np.float64(points[k, 0]), np.float64(points[k, 1]), np.float64(points[k, 2])
        depth_m = P[2, 0] * x + P[2, 1] * y + P[2, 2] * z + P[2, 3]
        if not (depth_m > nearest_m and depth_m < farthest_m):
            continue
        column = (P[0, 0] * x + P[0, 1] * y + P[0, 2] * z + P[0, 3]) / depth_m / cell_px
        row = (P[1, 0] * x + P[1, 1] * y + P[1, 2] * z + P[1, 3]) / depth_m / cell_px
        if not (column >= 0 and row >= 0 and column < columns and row < rows):
            continue
        add_point(x, y, z, moments[int(row), int(column)])
    return moments


@compiled((array_of(np.float64, 3), _ROWS, NUMBER, array_of(np.int64, 2), WHOLE, WHOLE))
def planes_at_pixels(
    moments: Float64, pixels: Float64, cell_px: float, windows: Int, min_returns: int, most: int
) -> Float64:
    """Return (K, 4) planes through the returns around pixels, n . x = d as n, d; NaN where these do not lie flat.

    The first window that holds enough returns, which are not all on one line, decides.

    Args:
        moments: (rows, columns, 10) moments of each cell.
        pixels: (K, 2) column and row within the image.
        cell_px: Edge of a cell in pixels.
        windows: (W, 2) cells to the sides and above and below, the smallest window first.
        min_returns: Number of returns that determine a plane.
        most: Number of planes that are looked for; the pixels after these have none.
    """
    found = 0
    planes = np.full((len(pixels), 4), np.nan)
    total, covariance = np.empty(10), np.empty((3, 3))
    rows, columns = moments.shape[:2]
    for k in range(len(pixels)):
        if found == most:
            break
        column, row = int(pixels[k, 0] / cell_px), int(pixels[k, 1] / cell_px)
        for w in range(len(windows)):
            total[:] = 0
            across, down = windows[w, 0], windows[w, 1]
            for i in range(max(row - down, 0), min(row + down + 1, rows)):
                for j in range(max(column - across, 0), min(column + across + 1, columns)):
                    for entry in range(10):
                        total[entry] += moments[i, j, entry]
            if total[0] < min_returns:
                continue
            write_covariance(total, covariance)
            nx, ny, nz = flattest_direction(covariance, _MIN_BREADTH, 1.0)
            if nx == 0 and ny == 0 and nz == 0:
                continue
            nx, ny, nz = flattest_direction(covariance, _MIN_BREADTH, _MAX_THICKNESS)
            x, y, z = total[1] / total[0], total[2] / total[0], total[3] / total[0]
            distance_m = np.sqrt(x * x + y * y + z * z)
            through = nx * x + ny * y + nz * z
            variance = (
                nx * (covariance[0, 0] * nx + 2 * (covariance[0, 1] * ny + covariance[0, 2] * nz))
                + ny * (covariance[1, 1] * ny + 2 * covariance[1, 2] * nz)
                + nz * covariance[2, 2] * nz
            )
            limit_m = _MAX_FLATNESS_M + _MAX_FLATNESS_SHARE * distance_m
            if variance < limit_m * limit_m and abs(through) > _MIN_GRAZING * distance_m:
                planes[k] = nx, ny, nz, through
                found += 1
            break
    return planes
