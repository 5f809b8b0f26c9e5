"""Corners of an image on flat surfaces of the scan, and where a later image shows them.

The surface tells how far away a corner is, and the motion of the LiDAR where it comes to be:

    corner in the image -- ray -- plane through the returns around -- point -- motion -- point later -- later image

With a wrong calibration the later image shows it elsewhere: turning the camera shifts the point that corners come from, and
a shift lets what is near come too fast or too slowly. It takes no edge that both sensors show.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import cv2
import numpy as np

from perception.calibration.grey_image import GreyImage
from perception.geometry.camera import project
from perception.geometry.se3 import inverse, motion_vector, rotation_vector
from perception.kernels.window_planes import moments_of_view, planes_at_pixels
from perception.maps.projection import rows_near_view
from perception.types import Bool, Float32, Float64, Frame

_MAX_CORNERS, _MIN_QUALITY, _MIN_DISTANCE_PX, _BLOCK_PX = 600, 0.005, 3.0, 3  # at half the size
_MARGIN_PX = 4  # around a corner, of pixels that tell how clear it is
_MAX_TRACKED = 250
# Cells of the image, a quarter of a degree wide whatever the camera, and the windows of them that hold a plane: of a dense
# LiDAR the first, of a sparse one the others.
_CELL_RAD = np.radians(0.24)
_WINDOWS = np.array([(2, 4), (3, 6), (6, 10)])
_MIN_RETURNS = 12
_NEAREST_M, _FARTHEST_M = 1.0, 60.0
# A tracked corner is off by some of a pixel, and by a share of its way: planes are not quite as far as they seem.
_PIXEL_DEVIATION, _SHARE_DEVIATION = 0.2, 0.02
_PATCH_PX, _PYRAMID_LEVELS, _ITERATIONS, _MIN_STEP_PX = 11, 1, 10, 0.02


@dataclass(frozen=True)
class ScanView:
    """The returns that an image shows.

    Attributes:
        size_px: Width and height of the image.
        image_P_cam: (3, 4) projection to its pixels.
        points_velo: (N, 4) returns in view, and some beside it, as measured.
        cam_SE3_velo: (4, 4) calibration that the frame came with.
    """

    size_px: tuple[int, int]
    image_P_cam: Float64
    points_velo: Float32
    cam_SE3_velo: Float64

    @classmethod
    def of(cls, frame: Frame, image: GreyImage) -> Self:
        """Return the returns of a frame with a calibration that its image shows."""
        assert frame.calibration is not None
        cam_SE3_velo = frame.calibration.cam_SE3_velo
        rows = rows_near_view(frame.points_velo, image.image_P_cam @ cam_SE3_velo, image.size_px)
        # An eighth of the time that an index in brackets takes.
        points_velo = np.take(frame.points_velo, rows, axis=0)
        return cls(image.size_px, image.image_P_cam, points_velo, cam_SE3_velo)

    @cached_property
    def center_m(self) -> Float64:
        """(3,) centre of the camera in its frame."""
        return np.asarray(-np.linalg.inv(self.image_P_cam[:, :3]) @ self.image_P_cam[:, 3])

    @property
    def cell_px(self) -> float:
        """Edge of a cell in pixels."""
        return float(_CELL_RAD * self.image_P_cam[0, 0])

    def moments(self, offset_SE3_cam: Float64) -> Float64:
        """Return the (rows, columns, 10) moments of the returns in the image's cells, with the calibration changed."""
        columns, rows = (int(np.ceil(length / self.cell_px)) for length in self.size_px)
        image_P_velo = self.image_P_cam @ offset_SE3_cam @ self.cam_SE3_velo
        return moments_of_view(
            self.points_velo, image_P_velo, self.cell_px, columns, rows, _NEAREST_M, _FARTHEST_M
        )

    def planes(self, moments: Float64, pixels: Float64) -> Float64:
        """Return (K, 4) planes through the returns around (K, 2) pixels, NaN where these do not lie flat or enough are found."""
        return planes_at_pixels(
            moments,
            np.ascontiguousarray(pixels),
            self.cell_px,
            _WINDOWS,
            _MIN_RETURNS,
            _MAX_TRACKED,
        )


@dataclass(frozen=True)
class SurfaceCorners:
    """K corners of an image on flat surfaces.

    Attributes:
        view: Returns that the image shows.
        pixels: (K, 2) corners.
        planes_velo: (K, 4) planes that they lie on, n . x = d as n, d.
        offset_SE3_cam: (4, 4) change of the calibration with which the planes were associated.
    """

    view: ScanView
    pixels: Float64
    planes_velo: Float64
    offset_SE3_cam: Float64

    @classmethod
    def find(cls, image: GreyImage, view: ScanView, offset_SE3_cam: Float64) -> Self:
        """Find the clearest corners that lie on flat surfaces.

        Args:
            image: Image.
            view: Returns that it shows.
            offset_SE3_cam: (4, 4) change of the calibration, as far as it is known.
        """
        moments = view.moments(offset_SE3_cam)
        pixels = _clear_corners(image, moments[..., 0] > 0)
        found = cls(view, pixels, view.planes(moments, pixels), offset_SE3_cam)
        return found[found.is_known]

    def __len__(self) -> int:
        """Return K."""
        return len(self.pixels)

    def __getitem__(self, rows: slice | Bool) -> Self:
        """Return some of the corners."""
        return replace(self, pixels=self.pixels[rows], planes_velo=self.planes_velo[rows])

    @property
    def is_known(self) -> Bool:
        """(K,) whether the plane of a corner is known."""
        return np.isfinite(self.planes_velo[:, 3])

    @cached_property
    def rays(self) -> Float64:
        """(K, 3) rays through the corners in the camera's frame."""
        cam_A_image = np.linalg.inv(self.view.image_P_cam[:, :3])
        return np.asarray(np.column_stack([self.pixels, np.ones(len(self))]) @ cam_A_image.T)

    @property
    def offset(self) -> Float64:
        """(6,) change of the calibration with which the planes were associated."""
        return motion_vector(self.offset_SE3_cam)

    def reassociated(self, offset_SE3_cam: Float64) -> Self:
        """Return the corners with the planes that a changed calibration shows there, NaN where there is none."""
        planes_velo = self.view.planes(self.view.moments(offset_SE3_cam), self.pixels)
        return replace(self, planes_velo=planes_velo, offset_SE3_cam=offset_SE3_cam)

    def surfaces_cam(self, offset_SE3_cam: Float64) -> "CornerSurfaces":
        """Return planes and rays in the camera's frame, with the calibration changed."""
        cam_SE3_velo = offset_SE3_cam @ self.view.cam_SE3_velo
        normals = self.planes_velo[:, :3] @ cam_SE3_velo[:3, :3].T
        distances_m = self.planes_velo[:, 3] + normals @ cam_SE3_velo[:3, 3]
        return CornerSurfaces(normals, distances_m, self.view.center_m, self.rays)


@dataclass(frozen=True)
class CornerSurfaces:
    """Planes of K corners and the rays through them, in the camera's frame.

    Attributes:
        normals: (K, 3) normals of the planes.
        distances_m: (K,) distances of the planes along them.
        center_m: (3,) centre of the camera, where the rays begin.
        rays: (K, 3) rays.
    """

    normals: Float64
    distances_m: Float64
    center_m: Float64
    rays: Float64

    @property
    def slopes(self) -> Float64:
        """(K,) how far a ray passes through its plane with each length of its own."""
        return np.asarray(np.einsum("ki,ki->k", self.normals, self.rays))

    def points_m(self) -> Float64:
        """Return (K, 3) where the rays meet the planes."""
        along = (self.distances_m - self.normals @ self.center_m) / self.slopes
        return np.asarray(self.center_m + along[:, None] * self.rays)


@dataclass(frozen=True)
class CornerTracks:
    """Corners on surfaces, tracked from one image into a later one.

    Attributes:
        corners: K corners in the first image.
        later_px: (K, 2) where the later image shows them.
        later_SE3_velo: (4, 4) the LiDAR's frame at the first time in its frame later.
        sweep: Motion of the LiDAR during its sweep.
    """

    corners: SurfaceCorners
    later_px: Float64
    later_SE3_velo: Float64
    sweep: "SweepVelocity"

    def __len__(self) -> int:
        """Return K."""
        return len(self.corners)

    def __getitem__(self, rows: Bool) -> Self:
        """Return some of the tracks."""
        return replace(self, corners=self.corners[rows], later_px=self.later_px[rows])

    @classmethod
    def track(
        cls,
        corners: SurfaceCorners,
        image: GreyImage,
        later: GreyImage,
        later_SE3_velo: Float64,
        sweep: "SweepVelocity",
    ) -> Self:
        """Find corners in a later image, near where the motion of the LiDAR brings them.

        Args:
            corners: Corners in the first image.
            image: First image.
            later: Later image of the same size.
            later_SE3_velo: (4, 4) motion of the LiDAR.
            sweep: Motion of the LiDAR during its sweep.
        """
        surfaces = corners.surfaces_cam(corners.offset_SE3_cam)
        cam_SE3_velo = corners.offset_SE3_cam @ corners.view.cam_SE3_velo
        moved = cam_SE3_velo @ later_SE3_velo @ inverse(cam_SE3_velo)
        expected_px, depths_m = project(later.image_P_cam @ moved, surfaces.points_m())
        inside = (expected_px >= 0) & (expected_px < later.size_px)  # false with NaN
        is_expected = inside.all(axis=1) & (depths_m > _NEAREST_M / 2)
        kept, start = corners[is_expected], corners.pixels[is_expected].astype(np.float32)
        if not len(kept):
            return cls(kept, np.empty((0, 2)), later_SE3_velo, sweep)
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            image.grey, later.grey, start, expected_px[is_expected].astype(np.float32),
            winSize=(_PATCH_PX, _PATCH_PX), maxLevel=_PYRAMID_LEVELS, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, _ITERATIONS, _MIN_STEP_PX),
        )  # fmt: skip
        is_found = status.ravel() == 1
        return cls(kept[is_found], found[is_found].astype(np.float64), later_SE3_velo, sweep)

    @cached_property
    def deviations_px(self) -> Float64:
        """(K,) standard deviations of the corners in the later image."""
        ways_px = np.linalg.norm(self.later_px - self.corners.pixels, axis=1)
        return np.asarray(np.hypot(_PIXEL_DEVIATION, _SHARE_DEVIATION * ways_px))

    @cached_property
    def sweep_shifts_m(self) -> Float64:
        """(K,) how far planes move along their normals if the LiDAR turns counter-clockwise."""
        offset_SE3_cam = self.corners.offset_SE3_cam
        points_cam = self.corners.surfaces_cam(offset_SE3_cam).points_m()
        velo_SE3_cam = inverse(offset_SE3_cam @ self.corners.view.cam_SE3_velo)
        points_velo = points_cam @ velo_SE3_cam[:3, :3].T + velo_SE3_cam[:3, 3]
        return self.sweep.shifts_m(self.corners.planes_velo, points_velo)

    def with_calibration(self, cam_SE3_velo: Float64) -> Self:
        """Return the tracks as of frames that came with another (4, 4) calibration."""
        view = replace(self.corners.view, cam_SE3_velo=cam_SE3_velo)
        corners = replace(self.corners, view=view).reassociated(np.eye(4))
        return replace(self, corners=corners)

    def reassociated(self, offset_SE3_cam: Float64) -> Self:
        """Return the tracks with the planes that a changed calibration shows at the corners."""
        return replace(self, corners=self.corners.reassociated(offset_SE3_cam))


@dataclass(frozen=True)
class SweepVelocity:
    """Motion of a LiDAR that measures the left and the right of an image at other times than its middle.

    Attributes:
        turn: (3,) turn in rad/s, in the LiDAR's frame.
        velocity: (3,) velocity in m/s.
        period_s: Time of a turn of the LiDAR.
    """

    turn: Float64
    velocity: Float64
    period_s: float

    @classmethod
    def between(cls, before_SE3_velo: Float64, gap_s: float, period_s: float) -> Self:
        """Return the velocity since a pose before.

        Args:
            before_SE3_velo: (4, 4) the LiDAR's frame now in its frame before.
            gap_s: Time between both.
            period_s: Time of a turn of the LiDAR.
        """
        turn = rotation_vector(before_SE3_velo[:3, :3]) / gap_s
        return cls(turn, before_SE3_velo[:3, 3] / gap_s, period_s)

    def shifts_m(self, planes_velo: Float64, points_velo: Float64) -> Float64:
        """Return how far (K, 4) planes at (K, 3) points move along their normals if the LiDAR turns counter-clockwise."""
        turns = np.arctan2(points_velo[:, 1], points_velo[:, 0]) / (2 * np.pi)
        along = np.cross(self.turn, points_velo) + self.velocity
        return np.asarray(self.period_s * turns * np.einsum("ki,ki->k", planes_velo[:, :3], along))


def _clear_corners(image: GreyImage, has_returns: Bool) -> Float64:
    """Return (K, 2) corners of an image where its cells have returns, the clearest first."""
    half = image.shrunk(0.5)
    around = cv2.dilate(has_returns.astype(np.uint8), np.ones((3, 3), np.uint8))
    mask = cv2.resize(around, half.size_px, interpolation=cv2.INTER_NEAREST)
    # Above the highest beam there is nothing to look for.
    top = max(int(mask.any(axis=1).argmax()) - _MARGIN_PX, 0)
    found = cv2.goodFeaturesToTrack(
        half.grey[top:], _MAX_CORNERS, _MIN_QUALITY, _MIN_DISTANCE_PX,
        mask=mask[top:], blockSize=_BLOCK_PX,
    )  # fmt: skip
    if found is None:
        return np.empty((0, 2))
    # A pixel of the half holds two of the whole.
    return np.asarray(2 * (found.reshape(-1, 2) + np.array([0.0, top])) + 0.5)
