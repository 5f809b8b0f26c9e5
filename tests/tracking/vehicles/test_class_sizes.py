"""Sizes of the classes: one table, and cars where a class is not in it."""

import numpy as np

from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors


def test_sizes_are_those_of_the_name_in_capitals_or_not():
    sizes = SizePriors.of(np.array(["Truck", "pedestrian", "Wagon"]))
    assert sizes.length_m[:, 0].tolist() == [10.11, 0.84, 3.88]
    assert sizes.height_m[:, 1].tolist() == [0.45, 0.11, 0.14]
    assert sizes.has_sides.tolist() == [True, False, True]
    assert len(SizePriors.of(np.array([], str))) == 0


def test_every_class_is_longer_than_wide():
    for name, size in CLASS_SIZES.items():
        assert size.length.mean_m > size.width.mean_m > 0, name
        assert size.height.mean_m > 4 * size.height.deviation_m, name
