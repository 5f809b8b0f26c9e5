import cv2
import numpy as np

from perception.render.color_model_plots import ColorModelScene, plot_color_model
from perception.tracking.single_object.color_model import color_ratios
from perception.tracking.single_object.config import ColorModelConfig, ImageMeanShiftConfig
from perception.tracking.single_object.fusion.color_localizer import image_mean_shift
from perception.tracking.single_object.image_region import region_of

SQUARE_PX = np.array([[40.0, 30], [60, 30], [60, 50], [40, 50]])


def scene(moved_px: int) -> ColorModelScene:
    image = np.full((80, 120, 3), 90, np.uint8)
    image[30:51, 40 + moved_px : 61 + moved_px] = (220, 20, 20)
    region = region_of(SQUARE_PX, (120, 80))
    measured = color_ratios(image, region)
    found = image_mean_shift(image, region, measured, ImageMeanShiftConfig())
    return ColorModelScene(image, found.regions, measured, measured)


def channels(path) -> list[np.ndarray]:
    return cv2.split(cv2.imread(str(path)).astype(int))


def test_region_ring_and_colours_are_drawn_in_their_colours(tmp_path):
    plot_color_model(tmp_path / "model.png", "a red square", scene(0))
    blue, green, red = channels(tmp_path / "model.png")
    left, right = slice(0, red.shape[1] // 4), slice(3 * red.shape[1] // 4, None)
    is_blue = (blue > 220) & (red < 90)
    is_red = (red > 200) & (green < 90) & (blue < 90)
    assert is_blue[:, left].sum() > 200  # Ω
    assert is_red[:, left].sum() > 200  # Ω† and the square
    assert is_red[:, left.stop : right.start].sum() > 20  # its one colour, before and after
    assert is_blue[:, right].sum() > 200  # the outline it climbed to
    # Nothing but the square is sure: its pixels are white, all around it black.
    assert ((red < 10) & (blue < 10))[:, right].sum() > 1000


def test_an_object_that_has_left_the_image_and_no_colours_is_drawn_too(tmp_path):
    gone = region_of(SQUARE_PX, (120, 80)).shifted(np.array([500.0, 0]), (120, 80))
    nothing = np.zeros(ColorModelConfig().bins)
    image = np.full((80, 120, 3), 90, np.uint8)
    plot_color_model(
        tmp_path / "gone.png", "gone", ColorModelScene(image, (gone,), nothing, nothing)
    )
    assert (tmp_path / "gone.png").stat().st_size > 0
