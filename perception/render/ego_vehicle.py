"""The recording vehicle as a simple solid, for views from outside."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from perception.types import Float64

# An estate car, its LiDAR above x = 0 (thesis Fig. 3.1): side view from the rear bumper over the roof
# to the front, in metres ahead of the LiDAR and above the ground.
_PROFILE_M = np.array(
    [
        (-1.95, 0.35),
        (-1.95, 0.95),
        (-1.65, 1.42),
        (0.35, 1.46),
        (1.25, 0.98),
        (2.60, 0.80),
        (2.85, 0.60),
        (2.85, 0.30),
    ]
)
_HALF_WIDTH_M = 0.9
# Edges of the profile that are glass: rear window and windscreen.
_GLASS_EDGES = (1, 3)
_WINDOW_M = np.array([(-1.55, 1.00), (-1.42, 1.36), (0.30, 1.39), (1.00, 1.00)])


@dataclass(frozen=True)
class Face:
    """One flat side of the vehicle.

    Attributes:
        corners_m: (C, 3) corners in the LiDAR frame, in order around the face.
        outward: (3,) unit normal that points outward.
        is_glass: Whether the face is drawn darker.
    """

    corners_m: Float64
    outward: Float64
    is_glass: bool = False


def vehicle_outline_m() -> Float64:
    """Return the (4, 2) corners of the outline from above, counter-clockwise from front left."""
    rear, front = _PROFILE_M[:, 0].min(), _PROFILE_M[:, 0].max()
    half = _HALF_WIDTH_M
    return np.array([(front, half), (rear, half), (rear, -half), (front, -half)])


@cache
def vehicle_faces() -> tuple[Face, ...]:
    """Return the faces of the vehicle on the ground at z = 0."""
    faces = []
    for number, (start, stop) in enumerate(pairwise(_PROFILE_M)):
        across = [(*start, 1), (*stop, 1), (*stop, -1), (*start, -1)]
        along = (stop - start) / np.linalg.norm(stop - start)
        outward = np.array([-along[1], 0.0, along[0]])
        faces.append(Face(_place(across), outward, number in _GLASS_EDGES))
    for side in (1, -1):
        outward = np.array([0.0, side, 0.0])
        body = [(*corner, side) for corner in _PROFILE_M]
        window = [(*corner, side * 1.01) for corner in _WINDOW_M]
        faces.append(Face(_place(body), outward))
        faces.append(Face(_place(window), outward, is_glass=True))
    return tuple(faces)


def _place(corners: list[tuple[float, ...]]) -> Float64:
    x, z, side = np.array(corners, np.float64).T
    return np.column_stack([x, side * _HALF_WIDTH_M, z])
