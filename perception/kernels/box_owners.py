"""Returns within upright boxes, by cells on the ground."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled
from perception.types import Float32, Float64, Int


@compiled((array_of(np.float32, 2), array_of(np.float64, 2), NUMBER, NUMBER, NUMBER))
def owners_in_boxes(
    points: Float32, boxes: Float64, cell_m: float, margin_m: float, ground_m: float
) -> Int:
    """Return (N,) the first box around each point, -1 without one.

    Args:
        points: (N, 3+) points.
        boxes: (M, 7) x, y, z of the middle of the bottom, length, width, height, heading.
        cell_m: Edge of the cells, each of which is in a box where its middle is.
        margin_m: Length by which boxes are grown to the sides and upwards.
        ground_m: Height above the bottom from which a point counts.
    """
    owners = np.full(len(points), -1, np.int64)
    reach_m = 0.0
    for row in range(len(boxes)):
        away_m = max(abs(boxes[row, 0]), abs(boxes[row, 1]))
        reach_m = max(reach_m, away_m + np.hypot(boxes[row, 3], boxes[row, 4]) / 2 + margin_m)
    half = int(reach_m / cell_m) + 2
    owner_of_cell = np.full((2 * half, 2 * half), -1, np.int16)
    for row in range(len(boxes) - 1, -1, -1):
        x, y, length_m, width_m = boxes[row, 0], boxes[row, 1], boxes[row, 3], boxes[row, 4]
        cos, sin = np.cos(boxes[row, 6]), np.sin(boxes[row, 6])
        around = int((np.hypot(length_m, width_m) / 2 + margin_m) / cell_m) + 1
        first_i, first_j = int(np.floor(x / cell_m)), int(np.floor(y / cell_m))
        for i in range(max(first_i - around, -half), min(first_i + around + 1, half)):
            for j in range(max(first_j - around, -half), min(first_j + around + 1, half)):
                dx, dy = (i + 0.5) * cell_m - x, (j + 0.5) * cell_m - y
                along, across = abs(cos * dx + sin * dy), abs(cos * dy - sin * dx)
                if along <= length_m / 2 + margin_m and across <= width_m / 2 + margin_m:
                    owner_of_cell[i + half, j + half] = row
    for k in range(len(points)):
        i = int(np.floor(points[k, 0] / cell_m)) + half
        j = int(np.floor(points[k, 1] / cell_m)) + half
        if 0 <= i < 2 * half and 0 <= j < 2 * half:
            row = owner_of_cell[i, j]
            if row >= 0:
                above_m = points[k, 2] - boxes[row, 2]
                if above_m >= ground_m and above_m <= boxes[row, 5] + margin_m:
                    owners[k] = row
    return owners
