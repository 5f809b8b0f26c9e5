import cv2
import numpy as np
import pytest

from perception.tracking.single_object.image_region import ImageRegion, region_of

SIZE_PX = (100, 60)
SQUARE_PX = np.array([[20.0, 10.0], [40.0, 10.0], [40.0, 30.0], [20.0, 30.0]])


def pixels(region: ImageRegion, part: str) -> np.ndarray:
    """Return (K, 2) columns and rows of the pixels inside the outline or in the ring."""
    return np.argwhere(getattr(region, f"is_{part}"))[:, ::-1] + region.corner_px


def test_a_square_holds_the_pixels_whose_centres_lie_in_it():
    region = region_of(SQUARE_PX, SIZE_PX)
    columns, rows = np.meshgrid(np.arange(20, 41), np.arange(10, 31))
    expected = np.column_stack([columns.ravel(), rows.ravel()])
    np.testing.assert_array_equal(pixels(region, "inside"), expected)
    np.testing.assert_allclose(region.center_px, [30, 20])
    np.testing.assert_allclose(region.box_px, [20, 10, 40, 30])


def test_the_ring_is_as_large_as_the_inside_and_apart_from_it():
    hull_px = np.array([[200.0, 100], [420, 90], [470, 180], [300, 260], [190, 200]])
    region = region_of(hull_px, (800, 400))
    assert len(pixels(region, "ring")) == pytest.approx(len(pixels(region, "inside")), rel=0.01)
    assert not (region.is_inside & region.is_ring).any()
    outer_area = cv2.contourArea(region.outer_px.astype(np.float32))
    assert outer_area == pytest.approx(2 * cv2.contourArea(hull_px.astype(np.float32)))


def test_the_centre_is_that_of_the_area_however_many_corners_one_side_has():
    many = np.column_stack([np.full(50, 40.0), np.linspace(11, 29, 50)])
    outline_px = np.vstack([SQUARE_PX[:2], many, SQUARE_PX[2:]])
    region = ImageRegion(outline_px, SIZE_PX)
    np.testing.assert_allclose(region.center_px, [30, 20])


@pytest.mark.parametrize("turn", [1, -1])
def test_pixels_are_those_of_a_test_of_each(turn):
    rng = np.random.default_rng(2)
    for _ in range(20):
        hull_px = region_of(rng.uniform((-30, -20), (130, 80), (7, 2)), SIZE_PX).hull_px
        region = ImageRegion(hull_px[::turn], SIZE_PX)
        found = np.zeros(SIZE_PX[::-1], bool)
        found[region.window] = region.is_inside
        contour = hull_px.astype(np.float32)[:, None]
        expected = [
            [cv2.pointPolygonTest(contour, (column, row), False) >= 0 for column in range(100)]
            for row in range(60)
        ]
        np.testing.assert_array_equal(found, expected)


def test_points_in_the_hull_leave_the_hull():
    rng = np.random.default_rng(0)
    more = np.vstack([rng.uniform((21, 11), (39, 29), (50, 2)), SQUARE_PX])
    np.testing.assert_array_equal(
        pixels(region_of(more, SIZE_PX), "inside"), pixels(region_of(SQUARE_PX, SIZE_PX), "inside")
    )


def test_an_outline_far_beyond_the_image_covers_all_of_it():
    region = region_of(1e7 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]), SIZE_PX)
    assert region.is_inside.shape == (60, 100)
    assert region.is_inside.all()
    assert len(pixels(region, "ring")) == 0


def test_what_leaves_the_image_comes_back_whole():
    region = region_of(SQUARE_PX, SIZE_PX)
    half_gone = region.shifted(np.array([-30.0, 0.0]), SIZE_PX)
    assert len(pixels(half_gone, "inside")) == 11 * 21
    gone = half_gone.shifted(np.array([-100.0, 0.0]), SIZE_PX)
    assert len(pixels(gone, "inside")) == len(pixels(gone, "ring")) == 0
    back = gone.shifted(np.array([130.0, 0.0]), SIZE_PX)
    np.testing.assert_array_equal(pixels(back, "inside"), pixels(region, "inside"))
    np.testing.assert_array_equal(pixels(back, "ring"), pixels(region, "ring"))


@pytest.mark.parametrize(
    "points_px",
    [
        np.zeros((0, 2)),
        np.array([[5.0, 5], [9, 9]]),
        np.array([[5.0, 5], [9, 9], [7, 7], [6, 6]]),
        np.array([[5.0, 5], [5, 5], [5, 5]]),
        np.array([[5.0, 5], [20, 5], [np.nan, np.nan]]),
        np.array([[5.2, 5.2], [5.4, 5.2], [5.3, 5.4]]),
        SQUARE_PX + 200,
    ],
    ids=["none", "two", "on a line", "one place", "one behind", "between pixels", "outside"],
)
def test_what_covers_no_pixel_is_no_region(points_px):
    assert region_of(points_px, SIZE_PX) is None


def test_points_behind_the_camera_are_left_out():
    points_px = np.vstack([SQUARE_PX, [[np.nan, np.nan], [np.inf, 0]]])
    np.testing.assert_array_equal(region_of(points_px, SIZE_PX).box_px, [20, 10, 40, 30])


def test_an_outline_without_area_has_no_pixel():
    region = ImageRegion(np.array([[5.0, 5], [20, 5], [9, 5]]), SIZE_PX)
    assert len(pixels(region, "inside")) == 0
    np.testing.assert_allclose(region.center_px, [34 / 3, 5])
