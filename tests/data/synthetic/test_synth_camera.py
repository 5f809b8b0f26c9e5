"""The camera: light and shadow where they must be, and what it sees where the LiDAR measures it."""

import numpy as np
import pytest

from data.synthetic import meshes
from data.synthetic.camera import Camera
from data.synthetic.exposure import Exposure, develop
from data.synthetic.lidar import velo_poses
from data.synthetic.light import Daylight
from data.synthetic.materials import Slot, palette
from data.synthetic.rig import PinholeCamera, default_calibration
from data.synthetic.street import Part
from perception.sensor import HDL_64E

CALIBRATION = default_calibration().camera
SUN_FROM_THE_LEFT = np.array([0.0, 1.0, 1.0]) / np.sqrt(2)
STILL = Exposure(gain=1.0, noise=0.0, blur_px=0.0)


def take(world, *, is_sunny: bool) -> tuple[np.ndarray, PinholeCamera]:
    pose = velo_poses(world, HDL_64E, np.zeros(1))[0]
    camera = Camera(world, CALIBRATION, Daylight(SUN_FROM_THE_LEFT, is_sunny, 0.0))
    image = camera.take(pose, 0.0, STILL, np.random.default_rng(0))
    return image.astype(float), PinholeCamera(CALIBRATION, pose)


def grey_at(image: np.ndarray, camera: PinholeCamera, place: tuple[float, float, float]) -> float:
    u, v = np.round(camera.project(np.array([place]))[0][0]).astype(int)
    return float(image[v - 2 : v + 3, u - 2 : u + 3].mean())


def test_a_wall_casts_a_shadow_away_from_the_sun(flat_world):
    wall = Part(meshes.box((8.0, 1.0, 0.0), (16.0, 1.2, 2.0), Slot.WALL), palette())
    image, camera = take(flat_world([wall]), is_sunny=True)
    shaded, lit = (12.0, 0.2, 0.0), (12.0, -2.5, 0.0)
    assert grey_at(image, camera, shaded) < 0.7 * grey_at(image, camera, lit)
    image, camera = take(flat_world([wall]), is_sunny=False)
    assert grey_at(image, camera, shaded) > 0.8 * grey_at(image, camera, lit)


def test_a_red_car_is_red_where_it_stands(flat_world):
    world = flat_world(cars=[(12.0, 0.0, 0.0)])
    world.scene.tables.palettes[:, Slot.PAINT, :3] = (0.5, 0.02, 0.02)
    image, camera = take(world, is_sunny=True)
    u, v = np.round(camera.project(np.array([[9.9, 0.0, 0.85]]))[0][0]).astype(int)
    red, green, blue = image[v - 2 : v + 3, u - 2 : u + 3].mean(axis=(0, 1))
    assert red > 1.6 * max(green, blue)
    assert image[20].mean() > image[350].mean()  # sky over road


def test_pixels_and_rays_are_inverse():
    camera = PinholeCamera(CALIBRATION, np.eye(4))
    pixels = np.array([[0.0, 0.0], [600.5, 180.25], [1241.0, 374.0]])
    rays = camera.rays(pixels)
    back, depth = camera.project(rays.origins_m + 20 * rays.directions)
    assert back == pytest.approx(pixels, abs=0.01)
    assert (depth > 10).all()


def test_noise_has_its_deviation():
    grey = np.full((100, 200, 3), 0.3, np.float32)
    clean = develop(grey, STILL, np.random.default_rng(0)).astype(float)
    noisy = develop(grey, Exposure(1.0, 3.0, 0.0), np.random.default_rng(0)).astype(float)
    assert (noisy - clean)[..., 1].std() == pytest.approx(3.0, rel=0.1)


def test_a_brighter_exposure_is_brighter():
    grey = np.full((10, 20, 3), 0.3, np.float32)
    images = [develop(grey, Exposure(g, 0.0), np.random.default_rng(0)).mean() for g in (0.8, 1.2)]
    assert images[1] > images[0] + 10
