import numpy as np
import pytest

from perception.kernels.rectangles import best_rectangles

# Ahead is x and the depth, left is y: 700 px a unit of y over x, from column 5000.
IMAGE_P_VELO = np.array([[5000.0, -700, 0, 0], [200, 0, -700, 0], [1, 0, 0, 0]])


# A length across the view is as long as the image shows; along it, as long as the class is.
@pytest.mark.parametrize(
    ("length_m", "is_across"), [(3.8, True), (4.2, True), (4.6, True), (4.2, False)]
)
def test_the_image_tells_the_length_of_a_vehicle_of_which_two_sides_are_seen(
    length_m: float, is_across: bool
) -> None:
    size_m = np.array([1.8, length_m] if is_across else [length_m, 1.8])
    near_m = np.array([3.0, 2.0])
    x, y = (near_m[:, None] + np.outer(size_m, [0, 1])).tolist()
    columns_px = [5000 - 700 * across / ahead for ahead in x for across in y]
    # Of the longer side no more than half a metre is seen.
    seen_m = np.minimum(size_m, [1.8, 0.5] if is_across else [0.5, 1.8])
    chosen, centers_m, sizes_m = best_rectangles(
        np.zeros((1, 1), np.float32),
        near_m.astype(np.float32).reshape(1, 1, 2),
        (near_m + seen_m).astype(np.float32).reshape(1, 1, 2),
        np.zeros((1, 1), np.float32),
        (np.array([[4.2, 0.4]]), np.array([[1.8, 0.1]])),
        (np.array([[min(columns_px), max(columns_px)]]), IMAGE_P_VELO, 1e4, np.array([-1.0])),
    )
    assert chosen.tolist() == [[0, is_across]]
    np.testing.assert_allclose(sizes_m[0], size_m, atol=1e-6)
    np.testing.assert_allclose(centers_m[0], near_m + size_m / 2, atol=1e-6)


def test_no_vehicles_have_no_rectangles() -> None:
    ends, numbers = np.zeros((0, 1, 2), np.float32), np.zeros((0, 2))
    spans = (numbers, IMAGE_P_VELO, 1e4, np.zeros(0))
    yaw_rad = np.zeros((0, 1), np.float32)
    chosen, _, _ = best_rectangles(yaw_rad, ends, ends, yaw_rad, (numbers, numbers), spans)
    assert chosen.shape == (0, 2)
