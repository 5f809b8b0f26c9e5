"""Colours that must not be mistaken for one another, also by the colour blind."""

from itertools import combinations

import numpy as np
import pytest

from perception.detection.bev.classes import BEV_CLASSES
from perception.render.palette import (
    CLASSES,
    FAINT_TEXT,
    GROUND,
    MOVING,
    STATIC,
    TRACKS,
    class_color,
    track_color,
)

# Linear RGB as perceived without one kind of cone (Machado, Oliveira and Fernandes 2009).
COLOR_VISIONS = {
    "normal": np.eye(3),
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(color, vision):
    """Return CIE L*a*b* of an sRGB colour."""
    encoded = np.array(color) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(
        XYZ @ np.clip(np.array(COLOR_VISIONS[vision]) @ linear, 0, 1) / XYZ.sum(axis=1)
    )
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", COLOR_VISIONS)
def test_tracks_differ_from_one_another_and_from_what_lies_below(vision):
    pairs = [*combinations(TRACKS, 2)]
    pairs += [(track, other) for track in TRACKS for other in (GROUND, STATIC, MOVING)]
    # A difference of 2 is just noticed; 10 is obvious.
    assert min(np.linalg.norm(lab(a, vision) - lab(b, vision)) for a, b in pairs) > 20


@pytest.mark.parametrize("vision", COLOR_VISIONS)
def test_classes_differ_from_one_another(vision):
    pairs = combinations(CLASSES.values(), 2)
    assert min(np.linalg.norm(lab(a, vision) - lab(b, vision)) for a, b in pairs) > 15


def test_every_class_that_a_detector_finds_has_a_colour():
    assert list(CLASSES) == list(BEV_CLASSES)


def test_a_class_has_its_colour_and_another_name_is_grey():
    assert class_color("Cyclist") == CLASSES["Cyclist"]
    assert class_color("Wagon") == FAINT_TEXT


def test_a_number_has_one_colour_its_neighbour_another_and_no_number_is_grey():
    assert track_color(9) == TRACKS[9 % len(TRACKS)]
    assert all(track_color(number) != track_color(number + 1) for number in range(20))
    assert track_color(-1) == FAINT_TEXT
