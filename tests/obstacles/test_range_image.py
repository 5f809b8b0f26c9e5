import numpy as np
import pytest

from perception.obstacles.range_image import RangeImage, SphericalProjection, Visibility
from perception.sensor import HDL_64E, SENSORS, VLP_16
from tests.rays import unit_rays

PROJECTION = SphericalProjection(HDL_64E, tolerance_m=0.1)
MARGIN_M = 0.2


def sphere(range_m, sensor=HDL_64E):
    """A return at one range in every direction of the sensor, in its own frame."""
    azimuth = np.arange(-np.pi, np.pi, sensor.azimuth_step_rad)
    return (unit_rays(azimuth, sensor.elevations_rad) * range_m).astype(np.float32)


@pytest.mark.parametrize("sensor", SENSORS.values(), ids=lambda sensor: sensor.name)
def test_places_before_at_and_behind_a_return(sensor):
    image = RangeImage(sphere(20.0, sensor), SphericalProjection(sensor, tolerance_m=0.1))
    visibility = image.visibility(
        np.array([[10, 0, 0], [19.9, 0, 0], [24, 0, 0]], np.float32), MARGIN_M
    )
    assert visibility.states.tolist() == [Visibility.FREE, Visibility.HIT, Visibility.OCCLUDED]
    np.testing.assert_allclose(visibility.gaps_m, [0, 0, 4], atol=1e-4)


def test_a_direction_without_a_beam_or_a_return_is_unknown():
    half = sphere(20.0)
    image = RangeImage(half[half[:, 0] > 1.0], PROJECTION)
    places = np.array([[0, 0, 10], [0, 0, -10], [-10, 0, 0]], np.float32)
    assert image.visibility(places, MARGIN_M).states.tolist() == [Visibility.UNKNOWN] * 3


def test_one_near_return_keeps_its_surroundings_from_being_free():
    pole = np.array([[10.0, 0.0, 0.0]], np.float32)
    image = RangeImage(np.vstack([sphere(20.0), pole]), PROJECTION)
    beside = np.array([[10, 0.08, 0], [10, 1.0, 0]], np.float32)
    before = beside * (0.6, 0.6, 0.6)
    assert image.visibility(beside, MARGIN_M).states.tolist() == [Visibility.HIT, Visibility.FREE]
    assert (
        image.visibility(before.astype(np.float32), MARGIN_M).states.tolist()
        == [Visibility.FREE] * 2
    )
    behind = (beside * 1.5).astype(np.float32)
    assert image.visibility(behind, MARGIN_M).states[1] == Visibility.FREE
    assert image.visibility(behind, MARGIN_M).states[0] != Visibility.FREE


@pytest.mark.parametrize("sensor", [HDL_64E, VLP_16], ids=lambda sensor: sensor.name)
def test_free_places_are_those_of_the_visibility(sensor):
    random = np.random.default_rng(0)
    whole, projection = sphere(20.0, sensor), SphericalProjection(sensor, tolerance_m=0.1)
    scan = whole * random.uniform(0.2, 1.5, (len(whole), 1))
    scan = scan[random.random(len(scan)) < 0.7].astype(np.float32)
    places = random.normal(0, (9, 9, 1.5), (20_000, 3)).astype(np.float32)
    for one in (RangeImage(scan, projection), RangeImage(whole, projection)):
        is_free = one.visibility(places, MARGIN_M).states == Visibility.FREE
        np.testing.assert_array_equal(one.are_free(places, MARGIN_M), is_free)
    assert 0.1 < is_free.mean() < 1


def test_the_turn_has_no_seam():
    image = RangeImage(sphere(20.0), PROJECTION)
    angles = np.linspace(-np.pi, np.pi, 2001)
    ring = np.stack([10 * np.cos(angles), 10 * np.sin(angles), 0 * angles], axis=1)
    assert (image.visibility(ring.astype(np.float32), MARGIN_M).states == Visibility.FREE).all()


def test_what_stands_between_two_beams_of_a_coarse_sensor_is_not_seen_through():
    """The beam below meets the thing's lower part or the ground before it."""
    points = sphere(60.0, VLP_16)
    post = np.array([[12.0, 0.0, z] for z in np.arange(-1.7, 0.3, 0.42)], np.float32)
    image = RangeImage(np.vstack([points, post]), SphericalProjection(VLP_16, tolerance_m=0.1))
    between = np.array([[12.0, 0.0, z] for z in np.arange(-1.2, 0.1, 0.05)], np.float32)
    assert not (image.visibility(between, MARGIN_M).states == Visibility.FREE).any()


@pytest.mark.parametrize("sensor", [VLP_16, SENSORS["VLP-32C"]], ids=lambda sensor: sensor.name)
def test_what_is_beside_beams_without_a_return_is_not_seen_through(sensor):
    """So is the far edge of a roof: the beams above pass over it, those below end in the windows."""
    points, lowest = sphere(60.0, sensor), sensor.beams // 2 + 1
    columns = len(points) // sensor.beams
    image = RangeImage(
        points[: (lowest + 1) * columns], SphericalProjection(sensor, tolerance_m=0.1)
    )
    above, here, below = sensor.elevations_rad[lowest - 1 : lowest + 2]
    elevations = np.array([0.7 * here + 0.3 * above, 0.7 * here + 0.3 * below])
    places = 20 * np.stack([np.cos(elevations), 0 * elevations, np.sin(elevations)], axis=1)
    visibility = image.visibility(places.astype(np.float32), MARGIN_M)
    assert visibility.states.tolist() == [Visibility.FREE, Visibility.UNKNOWN]


def is_bounded(target, place, returned, reach_rad):
    """Whether rows with a return are on both sides of a place, next to it or within reach of the row next to it."""
    row, following = target.rows[place], target.next_rows[place]
    side = following - row or 1

    def has_return(first, step):
        is_outward = (returned - first) * step >= 0
        away_rad = np.abs(HDL_64E.elevations_rad[returned] - HDL_64E.elevations_rad[first])
        return (is_outward & (away_rad <= reach_rad)).any()

    return has_return(row, -side) and has_return(following, side)


def test_the_nearest_return_of_a_block_is_the_one_a_loop_finds():
    rng = np.random.default_rng(3)
    points = rng.normal(0, 10, (3000, 3)).astype(np.float32)
    image, at = RangeImage(points, PROJECTION), PROJECTION.pixels(points)
    places = rng.normal(0, 6, (60, 3)).astype(np.float32)
    target = PROJECTION.pixels(places)
    finer = PROJECTION.level_0_from_m / target.ranges_m
    levels = np.searchsorted([1.0, 2.0, 4.0], finer)
    for place in range(len(places)):
        rows, columns = PROJECTION.blocks[levels[place]]
        turn = np.abs(at.columns - target.columns[place])
        near = (np.abs(at.rows - target.rows[place]) <= rows) & at.is_in_view
        is_beside = np.minimum(turn, PROJECTION.columns - turn) <= columns
        nearest = at.ranges_m[near & is_beside].min(initial=np.inf)
        expected = np.isfinite(nearest) and nearest > target.ranges_m[place] + MARGIN_M
        returned = np.unique(at.rows[at.is_in_view & is_beside])
        expected &= is_bounded(target, place, returned, columns * PROJECTION.column_step_rad)
        states = image.visibility(places[place : place + 1], MARGIN_M).states
        assert (states[0] == Visibility.FREE) == (expected and target.is_in_view[place])


def test_no_points_give_no_visibility():
    image = RangeImage(sphere(20.0), PROJECTION)
    assert len(image.visibility(np.zeros((0, 3), np.float32), MARGIN_M).states) == 0
