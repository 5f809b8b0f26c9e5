"""What a camera looks at: one moment of a world, and what each pixel of a band of rows sees of it."""

from dataclasses import dataclass

from data.synthetic.raycasting import Hits, MovingObject, Rays
from data.synthetic.rig import PinholeCamera
from perception.types import Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class RenderState:
    """What is the same for all bands of one image.

    Attributes:
        pinhole: the camera in its place.
        velo_to_world: (3, 3) rotation of the LiDAR.
        moving: what moves in view.
        casting: those of it near enough to cast shadows.
        footprints: pose, length and width of the vehicles around.
    """

    pinhole: PinholeCamera
    velo_to_world: Float32
    moving: list[MovingObject]
    casting: list[MovingObject]
    footprints: list[tuple[Float64, float, float]]


@dataclass(frozen=True)
class GBuffer:
    """What the pixels of one band see.

    Attributes:
        rows: of the image.
        shape: rows and columns of the band.
        rays: one a pixel, row by row.
        hits: where they end.
        seen: (K,) pixels that see something.
        slots: (K,) material.
        points: (K, 3) in the world.
        normals: (K, 3) towards the camera.
    """

    rows: slice
    shape: tuple[int, int]
    rays: Rays
    hits: Hits
    seen: Int
    slots: UInt8
    points: Float32
    normals: Float32
