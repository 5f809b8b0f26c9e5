"""Sun and sky, the camera's settings, and the light that reaches places by both."""

from dataclasses import replace

import numpy as np
import pytest

from data.synthetic import meshes
from data.synthetic.camera import Camera
from data.synthetic.drive import SyntheticDrive
from data.synthetic.exposure import Exposure, develop, draw_exposure
from data.synthetic.lidar import velo_poses
from data.synthetic.light import Daylight, draw_daylight, glow, headlight
from data.synthetic.materials import Slot, palette
from data.synthetic.rig import PinholeCamera, default_calibration
from data.synthetic.street import Part
from perception.sensor import HDL_64E

CALIBRATION = default_calibration().camera
PLAIN = Exposure(noise=0.0, blur_px=0.0, contrast=1.0, vignette=0.0)
AHEAD = np.array([1.0, 0.0, 0.0])


def sun_at(azimuth_rad: float, elevation_rad: float = np.pi / 4) -> np.ndarray:
    level = np.cos(elevation_rad)
    return np.array(
        [level * np.cos(azimuth_rad), level * np.sin(azimuth_rad), np.sin(elevation_rad)]
    )


def grey_at(world, daylight: Daylight, place: tuple[float, float, float]) -> float:
    pose = velo_poses(world, HDL_64E, np.zeros(1))[0]
    image = Camera(world, CALIBRATION, daylight).take(pose, 0.0, PLAIN, np.random.default_rng(0))
    u, v = np.round(PinholeCamera(CALIBRATION, pose).project(np.array([place]))[0][0]).astype(int)
    return float(image[v - 1 : v + 2, u - 1 : u + 2].mean())


@pytest.mark.parametrize("side", [-1, 1])
def test_a_box_shades_the_side_away_from_the_sun(flat_world, side):
    box = Part(meshes.box((13.0, -0.5, 0.0), (15.0, 0.5, 1.5), Slot.WALL), palette())
    daylight = Daylight(sun_at(side * np.pi / 2), True, 0.0)
    # At 45 degrees the shadow is as long as the box is high.
    shaded = grey_at(flat_world([box]), daylight, (14.0, -side * 1.2, 0.0))
    beyond = grey_at(flat_world([box]), daylight, (14.0, -side * 2.6, 0.0))
    towards = grey_at(flat_world([box]), daylight, (14.0, side * 1.2, 0.0))
    assert shaded < 0.6 * beyond
    assert beyond == pytest.approx(towards, rel=0.25)


@pytest.mark.parametrize("is_sunny", [True, False])
def test_the_ground_under_a_car_is_nearly_black(flat_world, is_sunny):
    world = flat_world(cars=[(12.0, 0.0, 0.0)])
    daylight = Daylight(sun_at(np.pi / 2), is_sunny, 0.0)
    under = grey_at(world, daylight, (10.3, 0.0, 0.0))
    assert under < 0.35 * grey_at(world, daylight, (10.3, 3.5, 0.0))


def test_a_surface_gets_the_sun_by_the_cosine(flat_world):
    """Light of level ground: albedo x (sun x sine of its height + sky), whatever the azimuth."""
    world, greys = flat_world(), []
    for elevation in np.radians([20.0, 60.0]):
        daylight = Daylight(sun_at(1.0, elevation), True, 0.0)
        greys.append(grey_at(world, daylight, (12.0, -6.0, 0.0)))
        assert daylight.sun_rgb[0] == pytest.approx(2.5)
    sky = Daylight(AHEAD, True, 0.0).sky_rgb[1]
    sun = [2.36 - 0.3 * (1 - np.sin(e)) for e in np.radians([20.0, 60.0])]
    light = [s * np.sin(e) + sky for s, e in zip(sun, np.radians([20.0, 60.0]), strict=True)]
    display = (light[1] / light[0]) ** (1 / 2.2)
    assert greys[1] / greys[0] == pytest.approx(display, rel=0.12)


def test_the_sky_is_brighter_about_the_sun_and_bluer_away_from_it():
    daylight = Daylight(sun_at(0.0, 0.4), True, 0.0, haze=0.3, cover=-9.0)
    high = np.array([[0.9, 0.0, 0.43], [-0.9, 0.0, 0.43]], np.float32)
    towards, away = daylight.sky(high)
    assert towards.sum() > 1.3 * away.sum()
    assert away[2] > 1.5 * away[0]
    white = replace(daylight, haze=1.0).sky(high)[1]
    assert white[2] < 1.4 * white[0]


def test_trees_stand_at_the_horizon_as_high_as_drawn():
    daylight = Daylight(sun_at(0.0), True, 0.0, cover=-9.0, skyline=0.05)
    turn = np.linspace(0, 6.2, 400)
    dark_share = []
    for rise in (0.003, 0.3):
        level = np.sqrt(1 - rise**2)
        rays = np.stack([level * np.cos(turn), level * np.sin(turn), np.full(400, rise)], axis=1)
        dark_share.append((daylight.sky(rays.astype(np.float32))[:, 1] < 0.4).mean())
    assert dark_share[0] > 0.7
    assert dark_share[1] == 0.0


def test_gloss_mirrors_the_sky_above_and_the_street_beside():
    daylight = Daylight(sun_at(0.0), True, 0.0, surround=0.3)
    up, level = np.array([[0, 0, 1]], np.float32), np.array([[1, 0, 0.05]], np.float32)
    place = np.zeros((1, 3), np.float32)
    assert daylight.mirrored(up, place).mean() > 2 * daylight.mirrored(level, place).mean()


def test_metering_evens_out_light_and_dark():
    rng = np.random.default_rng(0)
    street = rng.uniform(0.1, 0.3, (60, 80, 3)).astype(np.float32)
    metering = replace(PLAIN, metering=1.0)
    bright, dark = (develop(street * k, metering, rng).mean() for k in (4.0, 0.25))
    assert bright == pytest.approx(dark, rel=0.02)
    assert develop(street * 4.0, PLAIN, rng).mean() > 2 * develop(street * 0.25, PLAIN, rng).mean()


def test_contrast_darkens_the_dark_and_saturation_parts_colours():
    dim = np.full((8, 8, 3), (0.06, 0.04, 0.03), np.float32)
    rng = np.random.default_rng(0)
    plain, steep = (develop(dim, replace(PLAIN, contrast=c), rng).mean() for c in (1.0, 1.8))
    assert steep < 0.7 * plain
    vivid = develop(dim, replace(PLAIN, saturation=1.5), rng)[0, 0].astype(int)
    pale = develop(dim, replace(PLAIN, saturation=0.5), rng)[0, 0].astype(int)
    assert np.ptp(vivid) > 2 * np.ptp(pale)


def test_a_mosaic_keeps_even_colours_and_softens_edges():
    rng, mosaic = np.random.default_rng(0), replace(PLAIN, has_mosaic=True)
    colour = np.full((12, 12, 3), (0.3, 0.2, 0.1), np.float32)
    assert (develop(colour, mosaic, rng)[2:-2, 2:-2] == develop(colour, PLAIN, rng)[0, 0]).all()
    edge = np.zeros((12, 12, 3), np.float32)
    edge[:, 6:] = 0.5
    assert len(np.unique(develop(edge, mosaic, rng)[5])) > len(np.unique(develop(edge, PLAIN, rng)))


def test_light_and_camera_depend_on_the_seed_alone():
    sun = sun_at(0.0)
    drawn = [draw_daylight(sun, True, np.random.default_rng(s)) for s in (1, 1, 2)]
    assert drawn[0] == drawn[1]
    assert drawn[0].haze != drawn[2].haze
    settings = [draw_exposure(np.random.default_rng(s)) for s in (1, 1, 2)]
    assert settings[0] == settings[1] != settings[2]
    once, again = (SyntheticDrive(2, seed=5).image(1) for _ in range(2))
    assert (once == again).all()


def test_at_night_the_road_is_lit_ahead_and_dark_beside_and_far_away(flat_world):
    night = Daylight(sun_at(0.0), False, 0.0, level=1e-3)
    near, far = (grey_at(flat_world(), night, (x, -1.0, 0.0)) for x in (8.0, 60.0))
    assert near > 4 * far
    day = grey_at(flat_world(), replace(night, level=1.0), (60.0, -1.0, 0.0))
    assert day > 10 * far


def test_headlights_fade_with_the_square_of_distance_and_light_little_above_their_edge():
    places = np.array([[11.6, 0, -1.05], [21.6, 0, -1.05], [21.6, 0, 3.0], [-10, 0, 0]], np.float32)
    towards = np.tile(np.array([[-1.0, 0, 0]], np.float32), (4, 1))
    light = headlight(places, towards, np.eye(4))[:, 0]
    assert light[0] / light[1] == pytest.approx(4.0, rel=0.05)
    assert light[2] < 0.05 * light[1]
    assert light[3] == 0.0


def test_lamps_shine_by_themselves():
    shining = glow(np.array([Slot.HEADLIGHT, Slot.TAILLIGHT, Slot.ASPHALT], np.uint8))
    assert shining[0].min() > 3
    assert shining[1, 0] > 10 * shining[1, 1]
    assert not shining[2].any()


def test_a_night_is_drawn_darker_by_hundreds_with_more_noise():
    day, night = (
        draw_daylight(sun_at(0.0), True, np.random.default_rng(4), is_night=is_night)
        for is_night in (False, True)
    )
    assert 1e-4 <= night.level <= 3e-3
    assert not night.sun_rgb.any()
    assert night.sky_rgb.max() < 0.005 * day.sky_rgb.max()
    noise = [
        draw_exposure(np.random.default_rng(4), is_night=is_night).noise
        for is_night in (True, False)
    ]
    assert noise[0] == pytest.approx(4 * noise[1])
