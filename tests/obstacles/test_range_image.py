import numpy as np
import pytest

from perception.obstacles.range_image import BeamRaster, RangeImage, Sight
from perception.sensor import HDL_64E, SENSORS, VLP_16

RASTER = BeamRaster(HDL_64E, tolerance_m=0.1)
MARGIN_M = 0.2


def sphere(range_m, sensor=HDL_64E):
    """A return at one range in every direction of the sensor, in its own frame."""
    azimuth = np.arange(-np.pi, np.pi, sensor.azimuth_step_rad)
    elevation, azimuth = np.meshgrid(sensor.elevations_rad, azimuth, indexing="ij")
    ray = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ],
        axis=-1,
    )
    return (ray.reshape(-1, 3) * range_m).astype(np.float32)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=lambda sensor: sensor.name)
def test_places_before_at_and_behind_a_return(sensor):
    image = RangeImage(sphere(20.0, sensor), BeamRaster(sensor, tolerance_m=0.1))
    sights = image.look(np.array([[10, 0, 0], [19.9, 0, 0], [24, 0, 0]], np.float32), MARGIN_M)
    assert sights.states.tolist() == [Sight.FREE, Sight.HIT, Sight.HIDDEN]
    np.testing.assert_allclose(sights.gaps_m, [0, 0, 4], atol=1e-4)


def test_a_direction_without_a_beam_or_a_return_says_nothing():
    half = sphere(20.0)
    image = RangeImage(half[half[:, 0] > 1.0], RASTER)
    places = np.array([[0, 0, 10], [0, 0, -10], [-10, 0, 0]], np.float32)
    assert image.look(places, MARGIN_M).states.tolist() == [Sight.UNKNOWN] * 3


def test_one_near_return_keeps_its_surroundings_from_being_free():
    pole = np.array([[10.0, 0.0, 0.0]], np.float32)
    image = RangeImage(np.vstack([sphere(20.0), pole]), RASTER)
    beside = np.array([[10, 0.08, 0], [10, 1.0, 0]], np.float32)
    before = beside * (0.6, 0.6, 0.6)
    assert image.look(beside, MARGIN_M).states.tolist() == [Sight.HIT, Sight.FREE]
    assert image.look(before.astype(np.float32), MARGIN_M).states.tolist() == [Sight.FREE] * 2
    behind = (beside * 1.5).astype(np.float32)
    assert image.look(behind, MARGIN_M).states[1] == Sight.FREE
    assert image.look(behind, MARGIN_M).states[0] != Sight.FREE


def test_the_turn_has_no_seam():
    image = RangeImage(sphere(20.0), RASTER)
    angles = np.linspace(-np.pi, np.pi, 2001)
    ring = np.stack([10 * np.cos(angles), 10 * np.sin(angles), 0 * angles], axis=1)
    assert (image.look(ring.astype(np.float32), MARGIN_M).states == Sight.FREE).all()


def test_what_stands_between_two_beams_of_a_coarse_sensor_is_not_seen_through():
    """The beam below meets the thing's lower part or the ground before it."""
    points = sphere(60.0, VLP_16)
    post = np.array([[12.0, 0.0, z] for z in np.arange(-1.7, 0.3, 0.42)], np.float32)
    image = RangeImage(np.vstack([points, post]), BeamRaster(VLP_16, tolerance_m=0.1))
    between = np.array([[12.0, 0.0, z] for z in np.arange(-1.2, 0.1, 0.05)], np.float32)
    assert not image.sees_through(between, MARGIN_M).any()


def test_seeing_through_is_what_look_calls_free():
    rng = np.random.default_rng(2)
    image = RangeImage(rng.normal(0, 8, (20000, 3)).astype(np.float32), RASTER)
    places = rng.normal(0, 8, (4000, 3)).astype(np.float32)
    free = image.look(places, MARGIN_M).states == Sight.FREE
    assert free.any()
    assert (image.sees_through(places, MARGIN_M) == free).all()


def test_the_nearest_return_of_a_block_is_the_one_a_loop_finds():
    rng = np.random.default_rng(3)
    points = rng.normal(0, 10, (3000, 3)).astype(np.float32)
    image, at = RangeImage(points, RASTER), RASTER.pixels(points)
    places = rng.normal(0, 6, (60, 3)).astype(np.float32)
    target = RASTER.pixels(places)
    levels = RASTER.levels(target.ranges_m)
    for place in range(len(places)):
        rows, columns = RASTER.blocks[levels[place]]
        turn = np.abs(at.columns - target.columns[place])
        near = (np.abs(at.rows - target.rows[place]) <= rows) & at.are_in_view
        near &= np.minimum(turn, RASTER.columns - turn) <= columns
        nearest = at.ranges_m[near].min(initial=np.inf)
        expected = np.isfinite(nearest) and nearest > target.ranges_m[place] + MARGIN_M
        seen = image.sees_through(places[place : place + 1], MARGIN_M)[0]
        assert seen == (expected and target.are_in_view[place])


def test_no_places_give_no_sights():
    image = RangeImage(sphere(20.0), RASTER)
    assert len(image.look(np.zeros((0, 3), np.float32), MARGIN_M).states) == 0
    assert len(image.sees_through(np.zeros((0, 3), np.float32), MARGIN_M)) == 0
