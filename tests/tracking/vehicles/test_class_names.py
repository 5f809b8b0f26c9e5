"""Classes by the names that sources give, and by heights."""

import numpy as np
import pytest

from perception.tracking.vehicles.class_names import (
    NAMED_CLASSES,
    class_likelihoods,
    height_likelihoods,
    log_shares,
)

_BOXES_PX = np.array([[100.0, 100.0, 300.0, 220.0]])


def likeliest(in_image, above, height_m=np.nan):
    """Return the class of an object by its names and the height in an image."""
    by_names = class_likelihoods(np.array([in_image]), np.array([above]), NAMED_CLASSES)
    by_height = height_likelihoods(np.array([height_m]), _BOXES_PX, NAMED_CLASSES)
    posterior = log_shares(NAMED_CLASSES) + by_names + by_height
    return NAMED_CLASSES[posterior.argmax(axis=1)].item()


@pytest.mark.parametrize(
    ("in_image", "above", "height_m", "expected"),
    [
        ("Car", "", np.nan, "Car"),
        ("Truck", "", np.nan, "Truck"),
        ("Truck", "Bus", np.nan, "Bus"),  # a camera knows no buses
        ("Truck", "Trailer", np.nan, "Truck"),
        ("Van", "Truck", np.nan, "Truck"),
        ("Car", "", 2.2, "Van"),
        ("Car", "", 1.5, "Car"),
        ("", "Motorcycle", np.nan, "Motorcycle"),
        ("Cyclist", "Bicycle", np.nan, "Bicycle"),
        ("Pedestrian", "Cyclist", np.nan, "Pedestrian"),
    ],
)
def test_the_class_is_the_likeliest_by_what_each_source_calls_such_objects(
    in_image, above, height_m, expected
):
    assert likeliest(in_image, above, height_m) == expected


def test_nothing_named_says_nothing():
    silent = np.array([""])
    np.testing.assert_array_equal(class_likelihoods(silent, silent, NAMED_CLASSES), 0.0)
    np.testing.assert_array_equal(
        height_likelihoods(np.array([np.nan]), _BOXES_PX, NAMED_CLASSES), 0.0
    )


def test_a_name_that_only_another_detector_gives_is_its_class():
    classes = np.array([*NAMED_CLASSES, "Tractor"])
    found = class_likelihoods(np.array(["Tractor"]), np.array([""]), classes)
    assert classes[found.argmax()] == "Tractor"


def test_an_impossible_height_is_doubted_rather_than_the_names():
    assert likeliest("Car", "Car", 9.0) == "Car"
