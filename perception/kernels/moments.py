"""Moments of points in ten numbers: their count and the sums of x, y, z, xx, xy, xz, yy, yz, zz."""

import numpy as np

from perception.kernels.compiled import NUMBER, array_of, compiled, written
from perception.types import Float64


@compiled((NUMBER, NUMBER, NUMBER, written(np.float64)))
def add_point(x: float, y: float, z: float, moments: Float64) -> None:
    """Add a point to (10,) moments."""
    moments[0] += 1
    moments[1], moments[2], moments[3] = moments[1] + x, moments[2] + y, moments[3] + z
    moments[4], moments[5], moments[6] = moments[4] + x * x, moments[5] + x * y, moments[6] + x * z
    moments[7], moments[8], moments[9] = moments[7] + y * y, moments[8] + y * z, moments[9] + z * z


@compiled((array_of(np.float64), written(np.float64, 2)))
def write_covariance(moments: Float64, covariance: Float64) -> None:
    """Write the upper triangle of the (3, 3) covariance by (10,) moments."""
    x, y, z = moments[1] / moments[0], moments[2] / moments[0], moments[3] / moments[0]
    covariance[0, 0] = moments[4] / moments[0] - x * x
    covariance[0, 1] = moments[5] / moments[0] - x * y
    covariance[0, 2] = moments[6] / moments[0] - x * z
    covariance[1, 1] = moments[7] / moments[0] - y * y
    covariance[1, 2] = moments[8] / moments[0] - y * z
    covariance[2, 2] = moments[9] / moments[0] - z * z


@compiled((array_of(np.float64, 2), NUMBER, NUMBER))
def flattest_direction(
    covariance: Float64, min_breadth: float, max_thickness: float
) -> tuple[float, float, float]:
    """Return the unit eigenvector of the smallest eigenvalue of a symmetric 3 x 3 matrix; 0 where there is no surface.

    Of points along a line any direction across it is as flat.

    Args:
        covariance: (3, 3) covariance of points; its upper triangle is read.
        min_breadth: Smallest ratio of the variances across and along a surface; points along a line have none.
        max_thickness: Largest ratio of the variances through and across a surface.
    """
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    d, e, f = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    mean = (a + d + f) / 3
    off = b * b + c * c + e * e
    spread = np.sqrt(((a - mean) ** 2 + (d - mean) ** 2 + (f - mean) ** 2 + 2 * off) / 6)
    if spread <= 1e-12 * mean or spread == 0:
        return 0.0, 0.0, 0.0
    p, q, r = (a - mean) / spread, (d - mean) / spread, (f - mean) / spread
    u, v, w = b / spread, c / spread, e / spread
    half_determinant = (p * (q * r - w * w) - u * (u * r - w * v) + v * (u * w - q * v)) / 2
    # Eigenvalues are mean + 2 spread cos(angle + k 2 pi / 3), with an angle of at most pi / 3.
    cosine = np.cos(np.arccos(min(max(half_determinant, -1.0), 1.0)) / 3)
    smallest = mean - spread * (cosine + np.sqrt(3 * (1 - cosine * cosine)))
    largest = mean + 2 * spread * cosine
    middle = 3 * mean - smallest - largest
    if middle < min_breadth * largest or smallest > max_thickness * middle:
        return 0.0, 0.0, 0.0
    # Rows of the matrix minus the eigenvalue are at right angles to the eigenvector: their longest cross product.
    a, d, f = a - smallest, d - smallest, f - smallest
    x1, y1, z1 = b * e - c * d, c * b - a * e, a * d - b * b
    x2, y2, z2 = b * f - c * e, c * c - a * f, a * e - b * c
    x3, y3, z3 = d * f - e * e, e * c - b * f, b * e - d * c
    n1, n2 = x1 * x1 + y1 * y1 + z1 * z1, x2 * x2 + y2 * y2 + z2 * z2
    n3 = x3 * x3 + y3 * y3 + z3 * z3
    if n2 > n1 and n2 >= n3:
        x1, y1, z1, n1 = x2, y2, z2, n2
    elif n3 > n1:
        x1, y1, z1, n1 = x3, y3, z3, n3
    if n1 <= 0:
        return 0.0, 0.0, 0.0
    length = np.sqrt(n1)
    return x1 / length, y1 / length, z1 / length
