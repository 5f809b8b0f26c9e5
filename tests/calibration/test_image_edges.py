"""Edges of an image, at the size of a common focal length."""

import numpy as np
import pytest

from perception.calibration.image_edges import find_image_edges
from perception.geometry.camera import project
from tests.board_scenes import TRUE


def image_of(columns):
    image = np.full((188, 621, 3), 60, np.uint8)
    image[:, columns] = 200
    return image


def test_an_upright_line_is_an_upright_edge():
    maps = find_image_edges(image_of(slice(300, None)), TRUE)
    assert maps.upright.shape == (188, 621)
    row = maps.upright[90].astype(float)
    assert row @ np.arange(621) / row.sum() == pytest.approx(299.5)
    assert maps.level[90].max() < 10


def test_a_smaller_image_shows_points_where_they_are():
    maps = find_image_edges(image_of(slice(300, None)), TRUE, max_focal_px=180)
    assert maps.upright.shape == (94, 310)
    full, _ = project(TRUE.image_P_cam, np.array([[-0.5, 0.1, 10.0]]))
    small, _ = project(maps.map_P_cam, np.array([[-0.5, 0.1, 10.0]]))
    # Two by two pixels become one; the last of 621 columns is left out.
    np.testing.assert_allclose((small + 0.5) / (full + 0.5), [[0.5, 0.5]])
    peak = (maps.upright[45].astype(float) @ np.arange(310)) / maps.upright[45].sum()
    assert abs((peak + 0.5) * 2 - 300) < 0.5


def test_a_grey_image_has_no_edge():
    maps = find_image_edges(np.full((188, 621, 3), 90, np.uint8), TRUE)
    assert not maps.upright.any()
    assert not maps.level.any()
