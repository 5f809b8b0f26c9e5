"""What each operation does to a crop, and that boxes go where the pixels go."""

import numpy as np
import pytest

from data.samples.crops.config import CropAugmentationConfig
from data.samples.crops.transforms import (
    CropSource,
    CropTransform,
    Occluder,
    crop_view,
    draw_transform,
    occlude_side,
    scale_depth,
    shift_rows,
)
from perception.detection.depthcn.crops import crop_windows
from perception.maps.encoding import decode_depth, encode_depth

HEIGHT, WIDTH = 66, 112
WINDOW = np.array([100.0, 40, 324, 172])  # twice the crop's size
BOX = np.array([170.0, 80, 260, 140])


def painted(box: np.ndarray = BOX) -> np.ndarray:
    """Return a picture that is 200 within a box."""
    image = np.zeros((240, 500, 3), np.uint8)
    x1, y1, x2, y2 = box.astype(int)
    image[y1 : y2 + 1, x1 : x2 + 1] = 200
    return image


def extent_share(crop: np.ndarray) -> np.ndarray:
    """Return where the painted box lies in a crop, as shares."""
    rows, columns = np.nonzero(crop[..., 1] > 100)
    x1, x2, y1, y2 = columns.min(), columns.max() + 1, rows.min(), rows.max() + 1
    return np.array([x1 / WIDTH, y1 / HEIGHT, x2 / WIDTH, y2 / HEIGHT])


TRANSFORMS = {
    "none": CropTransform(),
    "larger": CropTransform(scale=1.3),
    "smaller": CropTransform(scale=0.7),
    "flip": CropTransform(is_flipped=True),
    "jitter": CropTransform(shift=(0.1, -0.07)),
    "wider": CropTransform(aspect=1.4),
    "rotation": CropTransform(rotation_rad=0.1),
    "other rotation": CropTransform(rotation_rad=-0.2),
    "all": CropTransform(1.1, 1.2, True, (0.05, 0.04), 0.9, None, 0.06),
}


@pytest.mark.parametrize("name", TRANSFORMS)
def test_the_box_goes_where_its_corners_go(name: str):
    view = crop_view(painted(), CropSource(WINDOW, 20.0, BOX), TRANSFORMS[name])
    # A pixel of the crop is 0.009 of its width and 0.015 of its height.
    np.testing.assert_allclose(extent_share(view.crop), view.normalized_box, atol=0.017)


def test_all_draws_together_keep_the_box_on_the_pixels():
    magnitudes = CropAugmentationConfig(occlusion=0.0, row_shift_px=0.0)
    for seed in range(20):
        transform = draw_transform(magnitudes, np.random.default_rng(seed))
        view = crop_view(painted(), CropSource(WINDOW, 20.0, BOX), transform)
        np.testing.assert_allclose(extent_share(view.crop), view.normalized_box, atol=0.017)


@pytest.mark.parametrize(
    ("transform", "expected"),
    [
        # Of the window's centre 212, 106 and size 224, 132.
        pytest.param(CropTransform(), (0.3125, 0.303, 0.714, 0.758), id="none"),
        pytest.param(CropTransform(is_flipped=True), (0.286, 0.303, 0.6875, 0.758), id="flip"),
        pytest.param(CropTransform(shift=(0.1, -0.1)), (0.4125, 0.203, 0.814, 0.658), id="jitter"),
        pytest.param(CropTransform(scale=2.0), (0.125, 0.106, 0.929, 1.015), id="scale"),
        pytest.param(CropTransform(aspect=4.0), (0.125, 0.4015, 0.929, 0.629), id="aspect"),
    ],
)
def test_shares_by_hand(transform: CropTransform, expected: tuple[float, ...]):
    view = crop_view(painted(), CropSource(WINDOW, 20.0, BOX), transform)
    np.testing.assert_allclose(view.normalized_box, expected, atol=6e-4)


def test_unchanged_it_is_what_runs_see():
    image = np.random.default_rng(0).integers(0, 256, (240, 500, 3), np.uint8)
    smooth = np.cumsum(np.cumsum(image, axis=1), axis=0)
    image = (255 * smooth / smooth.max()).astype(np.uint8)
    view = crop_view(image, CropSource(WINDOW, 20.0, BOX), CropTransform())
    at_run_time = crop_windows(image, WINDOW[None])[0].transpose(1, 2, 0)
    assert np.abs(view.crop.astype(int) - at_run_time).max() <= 1


def test_what_is_no_vehicle_has_no_box():
    view = crop_view(painted(), CropSource(WINDOW, 20.0, np.full(4, np.nan)), TRANSFORMS["all"])
    assert np.isnan(view.normalized_box).all()


def scene_crop(depth_m: float = 20.0) -> np.ndarray:
    """Return an object of one depth, nothing known of the uppermost rows."""
    crop = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    crop[..., 0] = encode_depth(np.array([depth_m], np.float32))[0]
    crop[..., 1], crop[..., 2] = 100, 80
    crop[:6] = 0
    return crop


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.3, 2.0])
def test_depth_alone_is_scaled(factor: float):
    crop = scene_crop()
    scaled = scale_depth(crop, factor)
    np.testing.assert_allclose(decode_depth(scaled[6:, :, 0]), 20 * factor, rtol=0.05)
    np.testing.assert_array_equal(scaled[..., 1:], crop[..., 1:])
    assert scaled[:6].max() == 0


def test_a_depth_too_near_to_be_encoded_is_known_all_the_same():
    crop = scene_crop(5.0)
    assert crop[30, 30, 0] == 0
    assert decode_depth(scale_depth(crop, 2.0)[30, 30, 0]) == pytest.approx(10, rel=0.05)


def test_a_cover_hides_one_side_by_a_nearer_surface():
    share = np.array([0.25, 0.2, 0.75, 0.9])  # columns 28 to 84
    occluded = occlude_side(scene_crop(), Occluder(0.25, True, 0.5, 0.4), share, 20.0)
    is_new = (occluded != scene_crop()).any(axis=(0, 2))
    assert np.flatnonzero(is_new).tolist() == list(range(14, 42))
    np.testing.assert_allclose(decode_depth(occluded[6:, 14:42, 0]), 10, rtol=0.03)
    # Half as deep, half as far below the eye: (136 + 100) / 2.
    assert (occluded[6:, 14:42, 1] == 118).all()
    assert (occluded[6:, 14:42, 2] == 102).all()
    assert occluded[:6].max() == 0


def test_a_cover_from_the_right_hides_the_right():
    share = np.array([0.25, 0.2, 0.75, 0.9])
    occluded = occlude_side(scene_crop(), Occluder(0.25, False, 0.5, 0.4), share, 20.0)
    is_new = (occluded != scene_crop()).any(axis=(0, 2))
    assert np.flatnonzero(is_new).tolist() == list(range(70, 98))


def test_what_is_nearer_than_the_cover_stays():
    crop = scene_crop(8.0)
    occluded = occlude_side(crop, Occluder(0.5, True, 0.5, 0.4), np.array([0.2, 0, 0.8, 1]), 20.0)
    np.testing.assert_array_equal(occluded, crop)


def test_lines_shift_by_their_own_number_of_pixels():
    crop = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    crop[..., 0] = np.arange(WIDTH)
    shifts = np.zeros(HEIGHT)
    shifts[:3] = 2.0, -3.0, 0.4
    shifted = shift_rows(crop, shifts)
    assert shifted[0, :5, 0].tolist() == [0, 0, 0, 1, 2]
    assert shifted[1, -5:, 0].tolist() == [110, 111, 111, 111, 111]
    np.testing.assert_array_equal(shifted[2:], crop[2:])
