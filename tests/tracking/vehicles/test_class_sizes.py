"""Sizes of the classes: one table, and cars where a class is not in it."""

import numpy as np

from perception.tracking.vehicles.class_sizes import CLASS_SIZES, SizePriors


def test_sizes_are_those_of_the_name_in_capitals_or_not():
    sizes = SizePriors.of(np.array(["Truck", "pedestrian", "Wagon"]))
    assert sizes.length_m[:, 0].tolist() == [10.11, 0.84, 3.88]
    assert sizes.height_m[:, 1].tolist() == [0.6, 0.11, 0.14]
    assert sizes.has_sides.tolist() == [True, False, True]
    assert len(SizePriors.of(np.array([], str))) == 0


def test_every_class_is_longer_than_wide():
    for name, size in CLASS_SIZES.items():
        assert size.length.mean_m > size.width.mean_m > 0, name
        assert size.height.mean_m > 4 * size.height.deviation_m, name


def test_an_object_may_be_of_another_class():
    sizes = SizePriors.of(np.array(["Cyclist", "Cyclist", "Pedestrian"]))
    found_m = np.array([[1.76, 0.6, 1.74], [1.0, 0.6, 1.74], [0.84, 0.66, 1.76]])
    one, often, no = np.ones(3), np.full(3, 100.0), np.zeros(3)
    # 15 % of cyclists are pedestrians, 30 % of pedestrians cyclists; never more than half are of another class.
    certain = sizes.deviations_m(found_m, one, no)[:, 0]
    np.testing.assert_allclose(certain, [0.18, np.hypot(0.18, 0.76), 0.23])
    variances = sizes.deviations_m(found_m, one, one)[:, 0] ** 2
    np.testing.assert_allclose(variances[0], 0.85 * 0.18**2 + 0.15 * (0.23**2 + 0.92**2))
    np.testing.assert_allclose(variances[2], 0.7 * 0.23**2 + 0.3 * (0.18**2 + 0.92**2))
    half = sizes.deviations_m(found_m, one, often)[0, 0] ** 2
    np.testing.assert_allclose(half, 0.5 * 0.18**2 + 0.5 * (0.23**2 + 0.92**2))
