import cv2
import numpy as np
import pytest

from perception.render.localization_plots import (
    GroundRemovalScene,
    PointMeanShiftScene,
    plot_ground_removal,
    plot_point_mean_shift,
)
from perception.tracking.single_object.config import PitchGroundConfig, PointMeanShiftConfig
from perception.tracking.single_object.localizer import Window, mean_shift_3d
from perception.tracking.single_object.pitch_ground import PitchedPlane
from perception.types import Boxes3D

BOX = Boxes3D(np.array([[12.0, 0, -1.7]]), np.array([[4.0, 1.8, 1.6]]), np.zeros(1))
IMAGE_P_VELO = np.array([[100.0, -100, 0, 0], [50.0, 0, -100, 0], [1, 0, 0, 0]])


def car_points(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform((10.0, -0.9, -1.5), (14.0, 0.9, -0.1), (count, 3))


@pytest.fixture
def points(rng) -> np.ndarray:
    x, y = np.meshgrid(np.arange(4, 40, 0.25), np.arange(-12, 12, 0.25))
    ground = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -1.73)])
    points = np.vstack([ground, car_points(rng, 600)])
    return np.column_stack([points, np.zeros(len(points))]).astype(np.float32)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def quarters(path) -> dict[str, np.ndarray]:
    """Return the figure's quarters as (h, w, 3) RGB."""
    image = cv2.imread(str(path)).astype(int)[..., ::-1]
    row, column = image.shape[0] * 45 // 100, image.shape[1] // 2
    return {
        "angle": image[:row, :column],
        "density": image[:row, column:],
        "removal": image[row:, :column],
        "image": image[row:, column:],
    }


def reds(image: np.ndarray) -> int:
    return int(((image[..., 0] > 200) & (image[..., 1:].max(axis=-1) < 90)).sum())


def greens(image: np.ndarray) -> int:
    return int(((image[..., 1] > 130) & (image[..., [0, 2]].max(axis=-1) < 90)).sum())


def blues(image: np.ndarray) -> int:
    return int(((image[..., 2] > 220) & (image[..., 0] < 90)).sum())


def removal_of(points: np.ndarray, **changes) -> GroundRemovalScene:
    values = {
        "plane": PitchedPlane(0.0, 1.73),
        "gate_rad": (-0.005, 0.005),
        "config": PitchGroundConfig(),
        "min_height_m": 0.2,
        "box_velo": BOX,
        "image": np.full((100, 200, 3), 128, np.uint8),
        "image_P_velo": IMAGE_P_VELO,
    }
    return GroundRemovalScene(points, **(values | changes))


def test_ground_is_red_and_ellipses_are_around_the_object(points, tmp_path):
    plot_ground_removal(tmp_path / "ground.png", "ground", removal_of(points))
    parts = quarters(tmp_path / "ground.png")
    assert blues(parts["angle"]) > 300  # the line to a point
    assert blues(parts["density"]) > 300
    assert reds(parts["density"]) > 300  # the pitch
    assert reds(parts["removal"]) > 5000
    assert greens(parts["removal"]) > 300
    assert reds(parts["image"]) > 300


def test_a_plane_below_all_points_removes_none(points, tmp_path):
    low = removal_of(points, plane=PitchedPlane(0.0, 4.0))
    plot_ground_removal(tmp_path / "ground.png", "no ground", low)
    assert reds(quarters(tmp_path / "ground.png")["removal"]) == 0


def test_without_a_camera_and_a_point_it_is_drawn_too(points, tmp_path):
    bare = removal_of(points[:0], image=None, image_P_velo=None, gate_rad=(-np.inf, np.inf))
    plot_ground_removal(tmp_path / "ground.png", "bare", bare)
    assert greens(cv2.imread(str(tmp_path / "ground.png"))) > 300


def test_the_last_window_of_a_mean_shift_is_brightest(rng, tmp_path):
    car = car_points(rng, 400)
    start = Window(np.array([10.5, 0.5, -1.0]), np.array([4.0, 1.8]), 0.0)
    windows = mean_shift_3d(car, start, PointMeanShiftConfig())
    assert len(windows) > 2
    scene = PointMeanShiftScene(car, windows, 1.6)
    plot_point_mean_shift(tmp_path / "shift.png", "shift", scene)
    image = cv2.imread(str(tmp_path / "shift.png")).astype(int)[..., ::-1]
    left, right = np.split(image, [image.shape[1] // 2], axis=1)
    for view in (left, right):
        assert blues(view) > 300
        is_dark_blue = (view[..., 2] > 120) & (view[..., 2] < 200) & (view[..., 0] < 60)
        assert is_dark_blue.sum() > 300
        assert greens(view) > 300


def test_a_window_without_points_is_drawn_too(tmp_path):
    window = Window(np.zeros(3), np.array([4.0, 1.8]), 0.5)
    scene = PointMeanShiftScene(np.zeros((0, 3)), (window,), 1.6)
    plot_point_mean_shift(tmp_path / "shift.png", "empty", scene)
    assert blues(cv2.imread(str(tmp_path / "shift.png"))[..., ::-1].astype(int)) > 300
