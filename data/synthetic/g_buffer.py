"""Geometry buffers of the camera: the state of the world at one time, and the surface behind each pixel."""

from dataclasses import dataclass

from data.synthetic.raycasting import Hits, MovingObject, Rays
from data.synthetic.rig import PinholeCamera
from perception.types import Float32, Float64, Int, UInt8


@dataclass(frozen=True)
class RenderState:
    """State of the world at the time of one image, shared by its bands.

    Attributes:
        pinhole: Pinhole camera at its pose.
        velo_to_world: (3, 3) rotation of the LiDAR.
        moving: Moving objects in view.
        casting: Moving objects near enough to cast shadows.
        footprints: Pose, length and width of the vehicles nearby.
    """

    pinhole: PinholeCamera
    velo_to_world: Float32
    moving: list[MovingObject]
    casting: list[MovingObject]
    footprints: list[tuple[Float64, float, float]]


@dataclass(frozen=True)
class GBuffer:
    """Surfaces behind the pixels of one band.

    Attributes:
        rows: Rows of the image.
        shape: Rows and columns of the band.
        rays: Rays, one per pixel, row by row.
        hits: Hits of the rays.
        seen: (K,) indices of the pixels whose ray meets a surface.
        slots: (K,) material slots.
        points: (K, 3) points in the world.
        normals: (K, 3) unit normals, turned towards the camera.
    """

    rows: slice
    shape: tuple[int, int]
    rays: Rays
    hits: Hits
    seen: Int
    slots: UInt8
    points: Float32
    normals: Float32
