"""Maps as 8-bit pictures."""

import numpy as np

from perception.maps.encoding import encode_depth, encode_reflectance


def test_depth_is_inverse_and_rounded():
    depth_m = np.array([[5, 10, 20, 40, 80]], np.float32)
    # 255 * 80 (z - 5) / (75 z): 0, 136, 204, 238, 255.
    assert encode_depth(depth_m).tolist() == [[0, 136, 204, 238, 255]]
    # 255 * 80 * 0.13 / (75 * 5.13) = 6.89: 7, where the floor would be 6.
    assert encode_depth(np.array([[5.13]], np.float32)).item() == 7


def test_depth_beyond_the_limits_takes_the_limits_value():
    assert encode_depth(np.array([[0, 1, 4.9, 81, 500]], np.float32)).tolist() == [
        [0, 0, 0, 255, 255]
    ]


def test_reflectance_is_scaled_and_rounded():
    assert encode_reflectance(np.array([[0, 0.1, 0.5, 1]], np.float32)).tolist() == [
        [0, 26, 128, 255]
    ]


def test_depth_is_known_to_half_a_step_after_the_round_trip():
    depth_m = np.linspace(5, 80, 2000, dtype=np.float32)
    code = encode_depth(depth_m[None])[0].astype(np.float64)
    # (6.2) solved for the depth. Half of one of 255 steps of inverse depth from 1/5 to 1/80.
    decoded_m = 255 * 80 * 5 / (255 * 80 - 75 * code)
    half_step = (1 / 5 - 1 / 80) / 255 / 2
    assert np.abs(1 / decoded_m - 1 / depth_m).max() < 1.001 * half_step
    assert (np.diff(code) >= 0).all()
