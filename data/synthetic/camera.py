"""The colour camera: casts rays through pixels and renders the light along them."""

import numpy as np

from data.synthetic.exposure import Exposure, develop
from data.synthetic.light import Daylight
from data.synthetic.raycasting import Hits, MovingObject, Rays, rotated
from data.synthetic.rig import IMAGE_SIZE_PX, PinholeCamera, near_pixels
from data.synthetic.shading import IS_ROUNDED, GBuffer, RenderState, Shader
from data.synthetic.world import World
from perception.kernels.rendering import place_surfaces, surface_normals
from perception.types import Calibration, Float32, Float64, Int, UInt8

_BAND_ROWS = 76  # the image is made in bands of rows, whose arrays stay in the processor's cache
_VIEW_M = 160.0
_OPENNESS_M = 45.0  # farther vehicles do not visibly darken the ground around them
_SHADOWS_M = 70.0  # farther moving objects cast none


class Camera:
    """A colour camera in one world."""

    def __init__(self, world: World, calibration: Calibration, daylight: Daylight) -> None:
        """Prepare what does not change from frame to frame."""
        self._world, self._calibration, self._daylight = world, calibration, daylight
        self._shader = Shader(world, daylight)
        width, height = calibration.image_size_px or IMAGE_SIZE_PX
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
        level = PinholeCamera(calibration, np.eye(4))
        self._directions_velo = level.rays(pixels.reshape(-1, 2).astype(float)).directions

    def take(
        self, world_SE3_velo: Float64, time_s: float, exposure: Exposure, rng: np.random.Generator
    ) -> UInt8:
        """Return the (H, W, 3) image at a time, the LiDAR being at a pose."""
        state = self._render_state(world_SE3_velo, time_s)
        width, height = state.pinhole.size_px
        bands = [
            self._band(state, slice(first, min(first + _BAND_ROWS, height)))
            for first in range(0, height, _BAND_ROWS)
        ]
        return develop(np.concatenate(bands).reshape(height, width, 3), exposure, rng)

    def _render_state(self, world_SE3_velo: Float64, time_s: float) -> RenderState:
        pinhole = PinholeCamera(self._calibration, world_SE3_velo)
        _, moving = self._world.moving_at(time_s, _VIEW_M)
        casting = [
            moving_object
            for moving_object in moving
            if np.linalg.norm(moving_object.world_SE3_object[:3, 3] - pinhole.centre_m) < _SHADOWS_M
        ]
        footprints = self._world.footprints(moving, pinhole.centre_m, _OPENNESS_M)
        return RenderState(pinhole, world_SE3_velo, moving, casting, footprints)

    def _band(self, state: RenderState, rows: slice) -> Float32:
        """Return (rows * W, 3) the light that some rows of pixels receive."""
        buffer = self._trace(state, rows)
        light = np.empty((len(buffer.hits.row), 3), np.float32)
        missed = np.flatnonzero(buffer.hits.row < 0)
        light[missed] = self._daylight.sky(buffer.rays.directions[missed])
        light[buffer.seen] = self._shader.shade(buffer, state)
        return light

    def _trace(self, state: RenderState, rows: slice) -> GBuffer:
        """Cast the rays of a band of pixels and gather the surfaces that they hit."""
        width = state.pinhole.size_px[0]
        pixels = slice(rows.start * width, rows.stop * width)
        rotation = state.world_SE3_velo[:3, :3].astype(np.float32)
        directions = self._directions_velo[pixels] @ rotation.T
        origins = np.empty_like(directions)
        origins[:] = state.pinhole.centre_m
        delays = np.zeros(len(directions), np.float32)
        rays = Rays(origins, directions, delays, near_pixels(state.pinhole, rows))
        hits = self._world.scene.cast(rays, state.moving)
        seen = np.flatnonzero(hits.row >= 0)
        tables = self._world.scene.tables
        slots = tables.slots.take(hits.row.take(seen))
        normals = self._normals(hits, seen, slots, state.moving)
        points = np.empty((len(seen), 3), np.float32)
        place_surfaces(points, normals, seen, rays.origins_m, rays.directions, hits.distance_m)
        shape = (rows.stop - rows.start, width)
        return GBuffer(rows, shape, rays, hits, seen, slots, points, normals)

    def _normals(self, hits: Hits, seen: Int, slots: UInt8, moving: list[MovingObject]) -> Float32:
        """Return unit normals, interpolated over rounded surfaces."""
        tables = self._world.scene.tables
        normals = np.empty((len(seen), 3), np.float32)
        faces = tables.face_normals, tables.corner_normals
        surface_normals(normals, seen, hits.row, IS_ROUNDED[slots], *faces, hits.u, hits.v)
        return rotated(normals, hits.moving[seen], moving)
